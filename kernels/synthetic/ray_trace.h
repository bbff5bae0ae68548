// Photographs of synthetic scenes with their exact truth: depth, motion, and who sees what.
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
                // where nothing is met
};

// Lambertian surfaces under a sun with shadows and a sky; with `highlights` glossy solids also
// mirror the sun (Blinn 1977), which depends on the view. Parallel over rows; the result does
// not depend on the number of threads.
SyntheticView RenderSyntheticView(const SyntheticScene& scene, const Camera& camera,
                                  bool highlights = false);

// [H, W, 1]: the share of each pixel's area in which the nearest thing is `solid`, an index
// into the scene's solids.
Image RenderSolidMask(const SyntheticScene& scene, const Camera& camera, int solid);

// Where the surface point seen at each pixel's centre of one view lies in another.
struct SyntheticMotion {
  int width = 0;
  int height = 0;
  std::vector<float> uv;  // [H, W, 2] pixels, to be added to (x, y); NaN where the point is not
                          // in front of the other camera, or where nothing is met
  std::vector<uint8_t> visible;  // [H, W] 1 where the other view sees the same point: inside
                                 // its picture, with nothing before it
};

SyntheticMotion TrueMotion(const SyntheticScene& scene, const Camera& from, const Camera& to);

}  // namespace regrade
