#include "stylize/image/distribution_transfer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/image/color_statistics.h"
#include "stylize/image/monge_kantorovich.h"
#include "stylize/image/regrain.h"

namespace regrade {
namespace {

constexpr int kQuantiles = 512;
constexpr double kSameColor = 0.5 / 255;  // half a step of 8 bits
constexpr uint64_t kRotationSeed = 0x1d7;

// The value below which the fraction (i + 1/2) / kQuantiles lies, between neighbours linear.
double Quantile(const std::vector<double>& sorted, int i) {
  const double place = (i + 0.5) / kQuantiles * static_cast<double>(sorted.size()) - 0.5;
  const double clamped = std::clamp(place, 0.0, static_cast<double>(sorted.size() - 1));
  const size_t below = static_cast<size_t>(clamped);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double fraction = clamped - static_cast<double>(below);
  return sorted[below] + fraction * (sorted[above] - sorted[below]);
}

// Uniform over all rotations: of a unit quaternion, Shoemake 1992.
Mat3d RandomRotation(uint64_t index) {
  const auto uniform = [&](uint64_t i) { return RandomDouble(kRotationSeed, index, i); };
  const double angle = 2 * std::numbers::pi;
  const double a = std::sqrt(1 - uniform(0)), b = std::sqrt(uniform(0));
  const double x = a * std::sin(angle * uniform(1)), y = a * std::cos(angle * uniform(1));
  const double z = b * std::sin(angle * uniform(2)), w = b * std::cos(angle * uniform(2));
  return {{{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
           {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
           {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}}};
}

Mat3d RotationOf(int turn) {
  constexpr Mat3d kIdentity{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  return turn == 0 ? kIdentity : RandomRotation(static_cast<uint64_t>(turn));
}

std::vector<double> SortedAxis(const std::vector<Vec3d>& colors, const Mat3d& rotation,
                               int axis) {
  std::vector<double> values(colors.size());
  for (size_t i = 0; i < colors.size(); ++i) values[i] = (rotation * colors[i])[axis];
  std::ranges::sort(values);
  return values;
}

Vec3d Turned(const DistributionMap::Turn& turn, const Vec3d& color) {
  const Vec3d place = turn.rotation * color;
  Vec3d moved;
  for (int c = 0; c < 3; ++c) moved[c] = turn.axes[c](place[c]) - place[c];
  Vec3d result = color;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 3; ++k) result[c] += turn.rotation(k, c) * moved[k];
  return result;
}

class DistributionTransfer : public ViewStylizer {
 public:
  DistributionTransfer(const StyleOptions& options, const Image& style,
                       const std::vector<Vec3d>* scene)
      : name_(options.method),
        regrain_(options.regrain),
        iterations_(ParseStyleMethod(options).kind == StyleMethodKind::kHistogram
                        ? 1
                        : options.iterations),
        style_(MeasureTurns(SampleColors(style, "the style picture"), iterations_)) {
    const Mat3d& c = MeasureColor(style).covariance;
    flat_ = std::max({c(0, 0), c(1, 1), c(2, 2)}) <= kRoundingVariance;
    if (options.scene_wide) scene_ = LearnDistributionMap(*scene, style_);
  }

  Image Stylize(const Image& view, int view_index) const override {
    const std::string where = "view " + std::to_string(view_index);
    CountNotFinite(view, where);
    const DistributionMap map =
        scene_ ? *scene_ : LearnDistributionMap(SampleColors(view, where), style_);
    Image colors = Colors(view);
#pragma omp parallel for schedule(static)
    for (int64_t i = 0; i < colors.num_pixels(); ++i) {
      float* p = &colors.pixels[3 * i];
      const Vec3d mapped = map({p[0], p[1], p[2]});
      for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(mapped[c]);
    }
    if (regrain_) colors = Regrain(Colors(view), colors);
    return WithColors(view, colors);
  }

  std::string Name() const override { return name_; }
  std::vector<std::string> Notices() const override {
    if (flat_) return {kFlatStyleNotice};
    return {};
  }

 private:
  std::string name_;
  bool regrain_;
  int iterations_;
  StyleTurns style_;
  bool flat_ = false;
  std::optional<DistributionMap> scene_;
};

}  // namespace

double MonotoneMap::operator()(double x) const {
  if (!(x > from.front())) return to.front() + (x - from.front());
  if (x >= from.back()) return to.back() + (x - from.back());
  const size_t i =
      static_cast<size_t>(std::upper_bound(from.begin(), from.end(), x) - from.begin()) - 1;
  return to[i] + (x - from[i]) / (from[i + 1] - from[i]) * (to[i + 1] - to[i]);
}

MonotoneMap MatchHistograms(const std::vector<double>& sorted_source,
                            const std::vector<double>& sorted_style) {
  REGRADE_CHECK(!sorted_source.empty() && !sorted_style.empty());
  MonotoneMap map;
  for (int i = 0; i < kQuantiles;) {
    const double first = Quantile(sorted_source, i);
    double from = 0, to = 0;
    int group = 0;
    for (; i < kQuantiles; ++i, ++group) {
      const double value = Quantile(sorted_source, i);
      if (value - first > kSameColor) break;
      from += value - first;
      to += Quantile(sorted_style, i);
    }
    map.from.push_back(first + from / group);
    map.to.push_back(to / group);
  }
  return map;
}

Vec3d DistributionMap::operator()(Vec3d color) const {
  for (const Turn& turn : turns) color = Turned(turn, color);
  return color;
}

StyleTurns MeasureTurns(const std::vector<Vec3d>& style, int iterations) {
  StyleTurns turns;
  turns.quantiles.resize(iterations);
#pragma omp parallel for schedule(static)
  for (int k = 0; k < 3 * iterations; ++k) {
    const std::vector<double> sorted = SortedAxis(style, RotationOf(k / 3), k % 3);
    std::vector<double>& quantiles = turns.quantiles[k / 3][k % 3];
    for (int i = 0; i < kQuantiles; ++i) quantiles.push_back(Quantile(sorted, i));
  }
  return turns;
}

DistributionMap LearnDistributionMap(std::vector<Vec3d> source, const StyleTurns& style) {
  DistributionMap map;
  for (size_t i = 0; i < style.quantiles.size(); ++i) {
    DistributionMap::Turn turn;
    turn.rotation = RotationOf(static_cast<int>(i));
    // The quantiles of kQuantiles quantiles are themselves.
#pragma omp parallel for schedule(static)
    for (int axis = 0; axis < 3; ++axis)
      turn.axes[axis] =
          MatchHistograms(SortedAxis(source, turn.rotation, axis), style.quantiles[i][axis]);
#pragma omp parallel for schedule(static)
    for (size_t k = 0; k < source.size(); ++k) source[k] = Turned(turn, source[k]);
    map.turns.push_back(std::move(turn));
  }
  return map;
}

std::vector<Vec3d> SampleColors(const Image& image, const std::string& where, int64_t most,
                                std::vector<double>* heights) {
  std::vector<Vec3d> all;
  std::vector<int64_t> pixels;
  const bool grey = image.channels < 3;
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    const float* p = &image.pixels[i * image.channels];
    if (image.channels == 4 && !(p[3] > 0.5f)) continue;
    const Vec3d color{p[0], p[grey ? 0 : 1], p[grey ? 0 : 2]};
    if (!std::isfinite(color.x + color.y + color.z)) continue;
    all.push_back(color);
    pixels.push_back(i);
  }
  if (all.empty()) throw InputError("the picture has no pixel to take a colour of", where);
  const int64_t count = std::ssize(all), kept = std::min(count, most);
  // By index, not by a whole stride: a stride that divides the width would see few columns.
  std::vector<Vec3d> sample(kept);
  if (heights != nullptr) heights->assign(kept, 0);
  for (int64_t i = 0; i < kept; ++i) {
    const int64_t drawn = i * count / kept;
    sample[i] = all[drawn];
    if (heights == nullptr) continue;
    const auto row = static_cast<double>(pixels[drawn] / image.width);
    (*heights)[i] = 1 - (row + 0.5) / image.height;
  }
  return sample;
}

std::unique_ptr<ViewStylizer> MakeDistributionTransfer(const StyleOptions& options,
                                                       const Image& style,
                                                       const std::vector<Vec3d>* scene) {
  const StyleMethodKind kind = ParseStyleMethod(options).kind;
  REGRADE_CHECK(kind == StyleMethodKind::kIdt || kind == StyleMethodKind::kHistogram);
  if (options.scene_wide) REGRADE_CHECK(scene != nullptr);
  return std::make_unique<DistributionTransfer>(options, style, scene);
}

}  // namespace regrade
