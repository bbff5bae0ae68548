#include "pipeline/capture/repeated_shots.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <tuple>

#include "kernels/image/resize.h"

namespace regrade {
namespace {

// Correlation of two pictures' colours: of one shot in two renderings, and of two exposures
// from one place, which a step to the side would lower.
constexpr double kAlike = 0.95, kSameFraming = 0.97;
constexpr double kSame = 1.5 / 255;  // mean difference of a picture and its copy
constexpr double kHalfStop = 0.5;
// Values between which both of two exposures show detail, and how many are enough to compare.
constexpr float kDark = 0.03f, kBright = 0.97f;
constexpr double kLeastCompared = 0.2;

bool SameAspect(const ShotLook& a, const ShotLook& b) {
  const double ratio = static_cast<double>(a.width) * b.height / (1.0 * a.height * b.width);
  return std::abs(std::log(ratio)) < 0.01;
}

double MeanDifference(const Image& a, const Image& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

// Correlation of the logarithms of values that show detail in both, which a change of exposure
// shifts by one amount; 0 if there are few, 1 for two pictures without any contrast.
double Correlation(const Image& a, const Image& b) {
  double n = 0, sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    const float va = a.pixels[i], vb = b.pixels[i];
    if (va < kDark || va > kBright || vb < kDark || vb > kBright) continue;
    const double x = std::log(va), y = std::log(vb);
    n += 1, sa += x, sb += y, aa += x * x, bb += y * y, ab += x * y;
  }
  if (n < kLeastCompared * static_cast<double>(a.pixels.size())) return 0;
  const double variance_a = aa - sa * sa / n, variance_b = bb - sb * sb / n;
  constexpr double kNoContrast = 1e-6;
  if (variance_a < kNoContrast * n || variance_b < kNoContrast * n)
    return variance_a < kNoContrast * n && variance_b < kNoContrast * n ? 1 : 0;
  return (ab - sa * sb / n) / std::sqrt(variance_a * variance_b);
}

// Seconds since 1970 in the camera's time zone.
std::optional<double> SecondsOf(const std::string& taken) {
  int year, month, day, hour, minute;
  double second;
  if (std::sscanf(taken.c_str(), "%d:%d:%d %d:%d:%lf", &year, &month, &day, &hour, &minute,
                  &second) != 6)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!date.ok()) return std::nullopt;
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600 * hour + 60 * minute + second;
}

double Stops(const ShotLook& photo) { return std::log2(photo.light); }

class ShotFinder {
 public:
  explicit ShotFinder(const std::vector<ShotLook>& photos)
      : photos_(photos), left_(photos.size()) {}

  std::vector<LeftShot> Find() {
    std::map<std::string, std::vector<size_t>> by_name, by_time;
    for (size_t i = 0; i < photos_.size(); ++i) {
      by_name[std::filesystem::path(photos_[i].file).replace_extension().string()].push_back(i);
      if (!photos_[i].taken.empty()) by_time[photos_[i].taken].push_back(i);
    }
    for (const auto& [name, members] : by_name)
      LeaveTwins(members, [](const ShotLook& a, const ShotLook& b) {
        return Correlation(a.small, b.small) >= kAlike;
      });
    for (const auto& [time, members] : by_time)
      LeaveTwins(members, [](const ShotLook& a, const ShotLook& b) {
        return MeanDifference(a.small, b.small) <= kSame;
      });
    LeaveBrackets();
    return std::move(left_);
  }

 private:
  bool Taken(size_t i) const { return left_[i].as.empty(); }

  // Of members that are the same, the best is taken.
  template <typename Same>
  void LeaveTwins(std::vector<size_t> members, const Same& same) {
    std::ranges::stable_sort(members, [this](size_t i, size_t j) {
      const ShotLook &a = photos_[i], &b = photos_[j];
      return std::tuple(a.bits, int64_t{a.width} * a.height) >
             std::tuple(b.bits, int64_t{b.width} * b.height);
    });
    for (size_t m = 0; m < members.size(); ++m)
      for (size_t k = 0; k < m && Taken(members[m]); ++k) {
        const ShotLook &best = photos_[members[k]], &photo = photos_[members[m]];
        if (Taken(members[k]) && SameAspect(best, photo) && same(best, photo))
          left_[members[m]] = {"second file of a shot", "the same shot as " + best.file};
      }
  }

  void LeaveBrackets() {
    std::vector<size_t> bracket;
    for (size_t i = 0; i < photos_.size(); ++i) {
      if (!Taken(i)) continue;
      if (!bracket.empty() && !Continues(bracket, i)) {
        LeaveAllButMiddle(bracket);
        bracket.clear();
      }
      bracket.push_back(i);
    }
    LeaveAllButMiddle(bracket);
  }

  bool Continues(const std::vector<size_t>& bracket, size_t i) const {
    const ShotLook &last = photos_[bracket.back()], &photo = photos_[i];
    if (!(photo.light > 0)) return false;
    for (const size_t member : bracket)  // an exposure that repeats begins another one
      if (!(photos_[member].light > 0) ||
          std::abs(Stops(photos_[member]) - Stops(photo)) < kHalfStop)
        return false;
    const auto before = SecondsOf(last.taken), now = SecondsOf(photo.taken);
    return before && now && std::abs(*now - *before) <= kBracketSeconds &&
           last.width == photo.width && last.height == photo.height &&
           Correlation(last.small, photo.small) >= kSameFraming;
  }

  void LeaveAllButMiddle(std::vector<size_t> bracket) {
    if (bracket.size() < 2) return;
    std::ranges::sort(bracket, {}, [this](size_t i) { return photos_[i].light; });
    const size_t middle = bracket[(bracket.size() - 1) / 2];
    for (const size_t i : bracket)
      if (i != middle)
        left_[i] = {"bracketed exposure", "another exposure of " + photos_[middle].file};
  }

  const std::vector<ShotLook>& photos_;
  std::vector<LeftShot> left_;
};

}  // namespace

Image LookOf(const Image& rgb) { return Resize(rgb, kLookSide, kLookSide); }

std::vector<LeftShot> RepeatedShots(const std::vector<ShotLook>& photos) {
  return ShotFinder(photos).Find();
}

}  // namespace regrade
