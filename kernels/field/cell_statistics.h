// What the training photos say of each cell of an adaptive field.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/grid_frame.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Of each cell, over the rays of all photos; [C] each.
struct CellStatistics {
  Buffer<float> weight;    // the largest w_i of EQ(composite)
  Buffer<float> pixels;    // its width in pixels in the photo that sees it second largest, of
                           // those that give it a weight of kSeenWeight; 0 if fewer than two do
  Buffer<uint64_t> error;  // sum of w_i |C - C_photo|^2, in units of kErrorUnit: integers, so
                           // the order is free
};
inline constexpr float kSeenWeight = 1e-3f;
inline constexpr double kErrorUnit = 0x1p-24;

// The width in pixels of a cell of `voxels` at `t` (world units) along a ray; `next` is the ray
// `stride` pixels beside it.
HD inline float WidthInPixels(const GridFrame& frame, const Ray& ray, const Ray& next, float t,
                              int stride, int voxels) {
  const Vec3f scale = frame.Scale();
  Vec3f apart, along;  // voxels
  for (int a = 0; a < 3; ++a) {
    apart[a] = (next.origin[a] - ray.origin[a] + (next.direction[a] - ray.direction[a]) * t) *
               scale[a];
    along[a] = ray.direction[a] * scale[a];
  }
  const Vec3f across = apart - along * (Dot(apart, along) / Dot(along, along));
  const float pixel = std::sqrt(Dot(across, across)) / static_cast<float>(stride);
  return static_cast<float>(voxels) / (pixel > 1e-20f ? pixel : 1e-20f);
}

}  // namespace regrade
