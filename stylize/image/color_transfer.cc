#include "stylize/image/color_transfer.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/image/color_spaces.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

// A step of 1 / 255 is about 0.4 units of L, and at least as much of a and b.
constexpr double kLabRoundingVariance = (100.0 / 255) * (100.0 / 255) / 12;

// Maps the colours of `view`; its alpha stays. One channel counts as R = G = B, and gets the
// mean of the mapped three.
template <typename Map>
Image MapColors(const Image& view, const Map& map) {
  Image result = view;
  const bool grey = view.channels < 3;
#pragma omp parallel for schedule(static)
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const float* p = view.at(x, y);
      float* q = result.at(x, y);
      const Vec3d mapped = map(Vec3d{p[0], p[grey ? 0 : 1], p[grey ? 0 : 2]});
      if (grey) {
        q[0] = static_cast<float>((mapped.x + mapped.y + mapped.z) / 3);
      } else {
        for (int c = 0; c < 3; ++c) q[c] = static_cast<float>(mapped[c]);
      }
    }
  }
  return result;
}

class ColorTransfer : public ViewStylizer {
 public:
  ColorTransfer(const StyleOptions& options, const Image& style, const ColorStatistics* scene)
      : options_(options),
        is_mkl_(ParseStyleMethod(options).kind == StyleMethodKind::kMkl),
        style_(MeasureForMethod(options, style)) {
    if (options.scene_wide) scene_ = *scene;
  }

  Image Stylize(const Image& view, int view_index) const override {
    const std::string where = "view " + std::to_string(view_index);
    CountNotFinite(view, where);
    const ColorStatistics source = scene_ ? *scene_ : Measure(view, where);
    if (is_mkl_) return MapColors(view, ComputeMkl(source, style_).map);
    const ChannelMap map = ComputeReinhard(source, style_);
    return MapColors(view, [&](const Vec3d& rgb) {
      Vec3d lab = LabFromSrgb(rgb);
      for (int c = 0; c < 3; ++c) lab[c] = map.slope[c] * lab[c] + map.offset[c];
      return SrgbFromLab(lab);
    });
  }

  std::string Name() const override { return options_.method; }

  std::vector<std::string> Notices() const override {
    if (is_mkl_ && scene_) return ComputeMkl(*scene_, style_).notices;
    const double rounding = is_mkl_ ? kRoundingVariance : kLabRoundingVariance;
    const Mat3d& c = style_.covariance;
    if (std::max({c(0, 0), c(1, 1), c(2, 2)}) <= rounding) return {kFlatStyleNotice};
    return {};
  }

 private:
  ColorStatistics Measure(const Image& view, const std::string& where) const try {
    return MeasureForMethod(options_, view);
  } catch (const Error& e) {
    throw Error(e.code(), e.what_failed(), where, e.hint());
  }

  StyleOptions options_;
  bool is_mkl_;
  ColorStatistics style_;
  std::optional<ColorStatistics> scene_;
};

}  // namespace

ChannelMap ComputeReinhard(const ColorStatistics& source_lab,
                           const ColorStatistics& style_lab) {
  ChannelMap map;
  for (int c = 0; c < 3; ++c) {
    const double source = source_lab.covariance(c, c), style = style_lab.covariance(c, c);
    const double weight = RankWeight(source / kLabRoundingVariance);
    map.slope[c] = weight > 0 ? weight * std::sqrt(style / source) : 0;
    map.offset[c] = style_lab.mean[c] - map.slope[c] * source_lab.mean[c];
  }
  return map;
}

ColorStatistics MeasureForMethod(const StyleOptions& options, const Image& image) {
  const StyleMethodKind kind = ParseStyleMethod(options).kind;
  if (kind == StyleMethodKind::kMkl) return MeasureColor(image);
  REGRADE_CHECK(kind == StyleMethodKind::kReinhard);
  return MeasureColor(image, LabFromSrgb);
}

std::unique_ptr<ViewStylizer> MakeColorTransfer(const StyleOptions& options, const Image& style,
                                                const ColorStatistics* scene) {
  if (options.scene_wide) REGRADE_CHECK(scene != nullptr);
  return std::make_unique<ColorTransfer>(options, style, scene);
}

}  // namespace regrade
