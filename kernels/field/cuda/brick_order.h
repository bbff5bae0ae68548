// An order of a grid's vertices that keeps neighbours along every axis close in memory: rays
// cross x as often as z, and in [X, Y, Z] a step along x is megabytes long.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"
#include "kernels/base/vec.h"

namespace regrade {

// Vertices in bricks of 4 x 4 x 4, z fastest within a brick and among bricks.
struct BrickOrder {
  int32_t row = 0;   // from a brick to the next along y
  int32_t slab = 0;  // from a brick to the next along x
  int64_t size = 0;  // vertices, including those that pad the last bricks

  BrickOrder() = default;
  explicit BrickOrder(const Vec3i& resolution)
      : row((resolution.z + 3) / 4 * 64),
        slab((resolution.y + 3) / 4 * row),
        size(int64_t{(resolution.x + 3) / 4} * slab) {}
  HD int32_t Index(int x, int y, int z) const {
    return (x >> 2) * slab + (y >> 2) * row + (z >> 2) * 64 + (x & 3) * 16 + (y & 3) * 4 +
           (z & 3);
  }
  HD Vec3i At(int32_t index) const {
    const int rest = index % slab;
    return {index / slab * 4 + (index >> 4 & 3), rest / row * 4 + (index >> 2 & 3),
            rest % row / 64 * 4 + (index & 3)};
  }
};

}  // namespace regrade
