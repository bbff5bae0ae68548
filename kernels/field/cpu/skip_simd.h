// Skips empty space along a ray, from one cube of empty bricks to the next; compiled once per
// instruction set.
#pragma once

#include <cstdint>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/ray_march.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

struct EmptySpace {
  const FastGrid& grid;
  Vec3i bricks;
  Vec3f direction, inverse;
  float steps_per_voxel;

  EmptySpace(const FastGrid& g, const GridRay<float>& march, float step)
      : grid(g), bricks(g.bricks()), direction(march.direction), steps_per_voxel(1 / step) {
    for (int a = 0; a < 3; ++a) inverse[a] = direction[a] != 0 ? 1 / direction[a] : 0.0f;
  }

  // The number of steps in empty cells, counted from the one at `p`; 0 if the brick of `p` is
  // not empty.
  int64_t StepsFrom(const Vec3f& p) const {
    int32_t brick[3];
    for (int a = 0; a < 3; ++a) {
      const float top = static_cast<float>(grid.frame.resolution[a] - 2);
      brick[a] = static_cast<int32_t>(p[a] >= 0 ? (p[a] <= top ? p[a] : top) : 0.0f) / kBrick;
    }
    const int32_t index = (brick[0] * bricks.y + brick[1]) * bricks.z + brick[2];
    const int32_t distance = grid.brick_distance[index];
    if (distance == 0) return 0;
    // All bricks nearer than `distance` are empty: a cube. The skip ends slightly before its
    // face, so that rounding cannot carry a skipped step beyond it.
    constexpr float kMargin = 1e-3f;
    float length = 3.4e38f;
    for (int a = 0; a < 3; ++a) {
      const float face = direction[a] > 0
                             ? static_cast<float>((brick[a] + distance) * kBrick) - kMargin
                             : static_cast<float>((brick[a] - distance + 1) * kBrick) + kMargin;
      const float until = (face - p[a]) * inverse[a];
      if (direction[a] != 0 && until < length) length = until;
    }
    return length > 0 ? 1 + static_cast<int64_t>(length * steps_per_voxel) : 1;
  }
};

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
