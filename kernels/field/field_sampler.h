// Values of a field, uniform or adaptive, at points of its box.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/radiance_field.h"

namespace regrade {

// The corners of the cell that holds a point, see EQ(trilinear).
struct CellCorners {
  int32_t voxel[8];  // -1 where nothing is stored
  Vec3f fraction;

  bool any() const;  // is there a corner of positive weight?
};

class FieldSampler {
 public:
  // Keeps a reference to `geometry`.
  explicit FieldSampler(const Geometry& geometry);

  // `place`: voxels of the finest level from the box's lowest corner, within the box.
  CellCorners At(const Vec3f& place) const;
  // Per world unit of length at a point in world units; 0 outside of the box.
  float DensityAt(const Vec3f& world) const;

 private:
  const Geometry& geometry_;
  CellsView cells_;
};

// out [channels] of values [N, channels].
void Blend(const CellCorners& corners, const Buffer<float>& values, int channels, float* out);

}  // namespace regrade
