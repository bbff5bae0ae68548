// How much of a view shows surfaces that only a few photos see: there the reconstruction rests
// on little evidence.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

inline constexpr int kDepthStride = 4;   // pixels between samples of a view's depth
inline constexpr int kFewestPhotos = 3;  // fewer are few: two photos cannot contradict a point

// A view's depth at every kDepthStride-th pixel, from the middle of the first such block.
struct SampledView {
  Camera camera;  // at the size of the picture
  Image depth;    // [H / stride, W / stride, 1], rounded up: z along the optical axis, world
                  // units; 0: no surface; negative: masked
};

// `depth` as RenderedView::depth, of the camera's size. `kept` is [H, W, 1], 0 where the photo
// is masked, or empty.
SampledView SampleView(const Camera& camera, const Image& depth, const Image& kept = {});

// The fraction, in [0, 1], of the view's surface points that fewer than kFewestPhotos photos
// see, over every second sample in x and y. Empty where the view shows no surface.
//
// A photo sees a point that lies at least `near` (world units) before it, in its frame, at a
// sample that is not masked, and not more than 5 % behind the farthest of the four samples
// around: at a silhouette one of them belongs to the surface behind. Samples without a surface
// hide nothing. A photo sees its own surfaces.
std::optional<double> SeenByFew(const SampledView& view, const std::vector<SampledView>& photos,
                                double near);

}  // namespace regrade
