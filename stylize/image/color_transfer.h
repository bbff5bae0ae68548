// 2D methods that move means and spreads of colours: Monge-Kantorovich and Reinhard's.
#pragma once

#include <memory>

#include "kernels/image/color_statistics.h"
#include "stylize/image/style_options.h"
#include "stylize/image/view_stylizer.h"

namespace regrade {

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

// For methods mkl and reinhard. `scene` is needed for scene_wide only. The style needs a pixel
// that is finite and opaque: Error(kInput).
std::unique_ptr<ViewStylizer> MakeColorTransfer(const StyleOptions& options, const Image& style,
                                                const ColorStatistics* scene = nullptr);

}  // namespace regrade
