// The built-in 2D methods: Monge-Kantorovich colour transfer and Reinhard's.
#pragma once

#include <memory>
#include <string>

#include "kernels/base/options.h"
#include "kernels/image/color_statistics.h"
#include "stylize/view_stylizer.h"

namespace regrade {

struct StyleOptions {
  std::string method = "mkl";
  bool scene_wide = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("method", method,
         {.help =
              "2D method that styles each view: mkl moves mean and covariance of the colours "
              "onto the style's, reinhard mean and spread of each CIELAB channel"});
    bind("scene-wide", scene_wide,
         {.help = "one colour map from the colours of all views, instead of one for each view: "
                  "steadier, but a view's own colours meet the style's less well"});
  }
};

// EQ(reinhard), Reinhard et al. 2001, in CIELAB, for each channel: x -> (x - m_x) k + m_y with
// k = w sigma_y / sigma_x. w, the rank rule RankWeight of monge_kantorovich.h at sigma_x^2 over
// the variance that 8-bit rounding gives a channel, is 1 for pictures with colour and 0 for a
// constant channel, which takes the style's mean: 0 / 0 is never formed, noise never amplified.
struct ChannelMap {
  Vec3d slope{};
  Vec3d offset{};
};
ChannelMap ComputeReinhard(const ColorStatistics& source_lab, const ColorStatistics& style_lab);

// Statistics of a picture in the space in which the method works: sRGB values for mkl (as in
// the paper), CIELAB for reinhard. Pooled over the views they are what scene_wide asks for.
ColorStatistics MeasureForMethod(const StyleOptions& options, const Image& image);

// `scene` is needed for scene_wide only. A method that does not exist: Error(kUsage) that lists
// them. The style needs a pixel that is finite and opaque: Error(kInput).
std::unique_ptr<ViewStylizer> MakeViewStylizer(const StyleOptions& options, const Image& style,
                                               const ColorStatistics* scene = nullptr);

}  // namespace regrade
