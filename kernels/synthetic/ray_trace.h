// Renders synthetic scenes with exact ground truth: depth, motion and visibility.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "kernels/synthetic/synthetic_scene.h"

namespace regrade {

// Exponent of the sun's highlights.
inline constexpr double kSunSharpness = 60;

struct SyntheticView {
  Image color;  // [H, W, 3] sRGB in [0, 1], each pixel the mean light of its area
  Image depth;  // [H, W, 1] z along the optical axis at the pixel's centre, world units; 0
                // where the ray hits nothing
};

// Lambertian surfaces under a sun with shadows and a sky; with `highlights` glossy solids also
// reflect the sun (Blinn 1977), which depends on the view. Parallel over rows; the result does
// not depend on the number of threads.
SyntheticView RenderSyntheticView(const SyntheticScene& scene, const Camera& camera,
                                  bool highlights = false);

// [H, W, 1]: the fraction of each pixel's area in which the nearest surface is `solid`, an
// index into the scene's solids.
Image RenderSolidMask(const SyntheticScene& scene, const Camera& camera, int solid);

// Position, in another view, of the surface point at each pixel's centre of one view.
struct SyntheticMotion {
  int width = 0;
  int height = 0;
  std::vector<float> uv;  // [H, W, 2] pixels, to be added to (x, y); NaN where the point is not
                          // in front of the other camera, or where the ray hits nothing
  std::vector<uint8_t> visible;  // [H, W] 1 where the other view sees the same point: inside
                                 // its image and not occluded
};

SyntheticMotion TrueMotion(const SyntheticScene& scene, const Camera& from, const Camera& to);

}  // namespace regrade
