#include "pipeline/commands/mix_keys.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

std::vector<double> ParsePoint(const std::string& text, int styles) {
  const auto refuse = [&](const std::string& why) {
    throw Error(ExitCode::kUsage, "\"" + text + "\" " + why, "--mix",
                styles == 1 ? "write shares of the style with colons between, like 0:1"
                            : "write a share for each of the " + std::to_string(styles) +
                                  " styles with commas between, and colons between the "
                                  "points, like 1,0:0,1 for two");
  };
  std::vector<double> shares;
  double sum = 0;
  for (const std::string& word : Split(text, ',')) {
    double share = 0;
    const char* const end = word.data() + word.size();
    const auto [rest, bad] = std::from_chars(word.data(), end, share);
    if (bad != std::errc() || rest != end || !std::isfinite(share)) refuse("is not a number");
    if (share < 0 || share > 1) refuse("is not between 0 and 1");
    shares.push_back(share);
    sum += share;
  }
  if (static_cast<int>(shares.size()) != styles)
    refuse("has " + std::to_string(shares.size()) + " shares for " + std::to_string(styles) +
           (styles == 1 ? " style" : " styles"));
  if (sum > 1 + 1e-9) refuse("adds up to more than 1");
  return shares;
}

}  // namespace

std::vector<double> MixKeys::At(double time) const {
  const double place = time * static_cast<double>(points.size() - 1);
  const size_t before = std::min(static_cast<size_t>(place), points.size() - 1);
  const double part = place - static_cast<double>(before);
  if (part == 0 || before + 1 == points.size()) return points[before];
  std::vector<double> shares = points[before];
  for (size_t i = 0; i < shares.size(); ++i)
    shares[i] = (1 - part) * points[before][i] + part * points[before + 1][i];
  return shares;
}

bool MixKeys::IsConstant() const {
  return std::all_of(points.begin(), points.end(),
                     [this](const auto& point) { return point == points[0]; });
}

MixKeys ParseMixKeys(const std::string& text, int styles) {
  MixKeys keys;
  if (text.empty()) {
    keys.points.emplace_back(static_cast<size_t>(styles), 0.0);
    for (int i = 0; i < styles; ++i) {
      keys.points.emplace_back(static_cast<size_t>(styles), 0.0);
      keys.points.back()[static_cast<size_t>(i)] = 1;
    }
    return keys;
  }
  for (const std::string& point : Split(text, ':'))
    keys.points.push_back(ParsePoint(point, styles));
  return keys;
}

}  // namespace regrade
