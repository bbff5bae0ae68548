// Where a camera sees a vertex of an adaptive field; see EQ(vertex-colors).
#pragma once

#include "kernels/field/cell_lattice.h"
#include "kernels/field/grid_frame.h"
#include "kernels/scene/pinhole_rays.h"

namespace regrade {

// In the field's space; 0 where the camera has no ray through the vertex.
HD inline Vec3f DirectionToVertex(const GridFrame& frame, CellKey key,
                                  const PinholeRays& camera) {
  const Vec3i at = PlaceOf(key);
  const Vec3f scale = frame.Scale();
  Vec3d p;
  for (int a = 0; a < 3; ++a)
    p[a] = frame.center[a] + (at[a] - frame.resolution[a] / 2) / double{scale[a]};
  return camera.DirectionTo(p);
}

}  // namespace regrade
