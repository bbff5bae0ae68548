// The box of a field and its division into voxels.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"
#include "kernels/base/vec.h"

namespace regrade {

// The grid's coordinate frame: values are at vertices (i, j, k) of a box. EQ(grid-from-world),
// svox2's cell-centred mapping:
//   g = p * N / (2 radius) + (1 - center / radius) * N / 2 - 1/2, so the box spans [-1/2, N -
//   1/2].
struct GridFrame {
  Vec3i resolution{0, 0, 0};  // vertices per axis, each >= 2
  Vec3f center{0, 0, 0};      // world units
  Vec3f radius{1, 1, 1};      // world units, half extents of the box

  HD Vec3f Scale() const {
    return {0.5f * resolution.x / radius.x, 0.5f * resolution.y / radius.y,
            0.5f * resolution.z / radius.z};
  }
  HD Vec3f Offset() const {
    const Vec3f s = Scale();
    return {0.5f * resolution.x - 0.5f - center.x * s.x,
            0.5f * resolution.y - 0.5f - center.y * s.y,
            0.5f * resolution.z - 0.5f - center.z * s.z};
  }
  Vec3f WorldOf(const Vec3f& grid) const {
    const Vec3f s = Scale(), o = Offset();
    return {(grid.x - o.x) / s.x, (grid.y - o.y) / s.y, (grid.z - o.z) / s.z};
  }
  int64_t NumVertices() const {
    return static_cast<int64_t>(resolution.x) * resolution.y * resolution.z;
  }
  // z fastest.
  HD int64_t Vertex(int x, int y, int z) const {
    return (static_cast<int64_t>(x) * resolution.y + y) * resolution.z + z;
  }
};

}  // namespace regrade
