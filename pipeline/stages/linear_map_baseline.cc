#include "pipeline/stages/linear_map_baseline.h"

#include <algorithm>
#include <cmath>

#include "evaluate/fidelity.h"
#include "kernels/image/color_statistics.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/stages/frame_gains.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

Vec3d PixelColor(const Image& image, int64_t pixel) {
  const float* c = &image.pixels[pixel * image.channels];
  return {c[0], c[1], c[2]};
}

// Squared error of the map over the frames' pixels, clipped as frames are.
double SquaredError(const ColorMap& map, const FrameSource& source, const FrameSource& target) {
  double sum = 0;
  for (int i = 0; i < source.count; ++i) {
    const Image from = source.frame(i), to = target.frame(i);
    double frame_sum = 0;
    for (int64_t p = 0; p < from.num_pixels(); ++p) {
      const Vec3d mapped = map(PixelColor(from, p)), target_color = PixelColor(to, p);
      if (!AllFinite(target_color)) continue;
      for (int c = 0; c < 3; ++c) {
        const double d = std::clamp(mapped[c], 0.0, 1.0) - target_color[c];
        frame_sum += d * d;
      }
    }
    sum += frame_sum;
  }
  return sum;
}

}  // namespace

std::optional<ColorMap> BestLinearMap(const FrameSource& source, const FrameSource& views_2d) {
  std::vector<ColorStatistics> before, after;
  LeastSquaresAccumulator accumulator;
  for (int i = 0; i < source.count; ++i) {
    Image from = source.frame(i);
    const Image to = views_2d.frame(i);
    if (!HasColor(to)) continue;
    for (size_t v = 0; v < from.pixels.size(); ++v)
      if (!std::isfinite(to.pixels[v])) from.pixels[v] = to.pixels[v];
    before.push_back(MeasureColor(from));
    after.push_back(MeasureColor(to));
    for (int64_t p = 0; p < from.num_pixels(); ++p)
      if (AllFinite(PixelColor(to, p))) accumulator.Add(PixelColor(from, p), PixelColor(to, p));
  }
  if (before.empty()) return std::nullopt;
  const ColorMap mkl = ComputeMkl(Pool(before), Pool(after)).map;
  const ColorMap least_squares = accumulator.Solve();
  return SquaredError(mkl, source, views_2d) < SquaredError(least_squares, source, views_2d)
             ? mkl
             : least_squares;
}

std::optional<double> LinearMapPsnr(const RadianceField& field,
                                    const std::vector<Camera>& cameras,
                                    const FrameSource& source, const FrameSource& views_2d,
                                    const FrameSource& transmittance, const PhotoGains& gains,
                                    Backend backend, const ProgressFunction& progress) {
  const std::optional<ColorMap> better =
      BestLinearMap(UndoGains(source, gains), UndoGains(views_2d, gains));
  if (!better) return std::nullopt;
  RadianceField mapped = field;
  mapped.appearance = ApplyColorMap(field.appearance, *better);
  mapped.background = MapBackground(*better, field.background);
  const FieldRenderer renderer(std::move(mapped), backend);
  const FrameSource rendered{source.count,
                             [&](int i) { return renderer.Render(cameras[i]).color; }};
  return MeasureFidelity({"linear_map", PutGains(rendered, gains)},
                         {views_2d, transmittance, nullptr, {}, {}, /*only_psnr=*/true},
                         progress)
      .psnr_to_2d_db;
}

}  // namespace regrade
