#include "pipeline/stages/control_sequences.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "kernels/image/color_statistics.h"
#include "kernels/image/gaussian_blur.h"
#include "pipeline/stages/linear_map_baseline.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

// Of the longer side: 3 pixels at 480.
constexpr double kBlur = 1.0 / 160;

Image Blurred(const Image& frame) {
  return GaussianBlur(frame, kBlur * std::max(frame.width, frame.height));
}

// Calls `change` with the three colours of every pixel; a grey frame becomes RGB first.
Image Changed(const Image& frame, const std::function<Vec3d(const Vec3d&)>& change) {
  Image changed(frame.width, frame.height, 3);
  for (int64_t p = 0; p < frame.num_pixels(); ++p) {
    const float* c = &frame.pixels[p * frame.channels];
    const int colour = frame.channels >= 3 ? 1 : 0;
    const Vec3d value = change({c[0], c[colour], c[2 * colour]});
    for (int k = 0; k < 3; ++k) changed.pixels[3 * p + k] = static_cast<float>(value[k]);
  }
  return changed;
}

Vec3d Grey(const Vec3d& c) {
  const double luma = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
  return {luma, luma, luma};
}

// Frames of any program may be grey, or have alpha, which is ignored.
FrameSource Rgb(const FrameSource& frames) {
  return {frames.count, [frames](int i) {
            return Changed(frames.frame(i), [](const Vec3d& c) { return c; });
          }};
}

std::optional<ColorMap> MapOf(const ControlInputs& inputs) {
  if (!WhyNoLinearMap(inputs).empty()) return std::nullopt;
  if (inputs.views_2d.count > 0)
    return BestLinearMap(Rgb(inputs.unstyled), Rgb(inputs.views_2d));
  std::vector<ColorStatistics> frames;
  for (int i = 0; i < inputs.unstyled.count; ++i)
    frames.push_back(MeasureColor(inputs.unstyled.frame(i)));
  return ComputeMkl(Pool(frames), MeasureColor(*inputs.style)).map;
}

}  // namespace

std::vector<NamedFrameSource> ControlSequences(const ControlInputs& inputs,
                                               const std::string& prefix) {
  std::vector<NamedFrameSource> controls;
  const auto add = [&](const char* name, const FrameSource& from, auto change) {
    controls.push_back(
        {prefix + name, {from.count, [from, change](int i) { return change(from.frame(i)); }}});
  };
  if (const std::optional<ColorMap> map = MapOf(inputs))
    add(kLinearMapControl, inputs.unstyled, [map = *map](const Image& frame) {
      return Changed(frame, [&map](const Vec3d& c) {
        Vec3d value = map(c);
        for (int k = 0; k < 3; ++k)  // NaN stays NaN
          value[k] = value[k] < 0 ? 0 : value[k] > 1 ? 1 : value[k];
        return value;
      });
    });
  add(kBlurredControl, inputs.styled, Blurred);
  add(kGreyControl, inputs.styled, [](const Image& frame) { return Changed(frame, Grey); });
  return controls;
}

std::string WhyNoLinearMap(const ControlInputs& inputs) {
  if (!inputs.one_map) return "only a part of the scene is styled";
  if (inputs.views_2d.count > 0) return "";
  if (inputs.style == nullptr)
    return "there are neither frames of the 2D method (--target) nor a style picture (--style)";
  return inputs.unstyled.count == 0 ? "there are no unstyled frames" : "";
}

std::vector<NamedFrameSource> ViewControls::Of(const std::vector<int>& of,
                                               const FrameSource& unstyled,
                                               const FrameSource& views_2d,
                                               const FrameSource& styled,
                                               bool with_photos) const {
  std::vector<NamedFrameSource> controls =
      ControlSequences({unstyled, styled, views_2d, style, one_map});
  if (!with_photos) return controls;
  const int count = static_cast<int>(of.size());
  controls.push_back({"photos", {count, [this, of](int k) {
                                   Image photo = views->Photo(of[k]);
                                   views->LeaveOutMasked(of[k], &photo);
                                   return photo;
                                 }}});
  controls.push_back({"photos_2d", {count, [this, of](int k) { return photo_2d(of[k]); }}});
  return controls;
}

}  // namespace regrade
