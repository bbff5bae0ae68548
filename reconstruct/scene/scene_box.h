// The part of a field's frame that is modelled, and how finely.
#pragma once

#include <optional>

#include "kernels/base/vec.h"

namespace regrade {

struct SceneBox {
  Vec3f center{0, 0, 0};
  Vec3f radius{1, 1, 1};
  float near_clip = 0;  // nothing is modelled nearer to a camera than this
  int layers = 0;       // most vertices along z; 0: as many as the radius asks for
  // Height (y) of a voxel over its width (x), in the box's units: 1 but in NDC, whose x and y
  // are the picture's sides, whatever their lengths.
  float voxel_aspect = 1;
  std::optional<Vec3f>
      background;        // sRGB behind everything; not given: the photos' mean colour
  bool spheres = false;  // what lies beyond the box is fitted on background spheres
};

// Vertices per axis where the longest side gets `longest`; voxels are cubes to within rounding.
// With `layers`, z gets that many at most, x and y share the rest, and a voxel is as many
// pixels wide as high.
Vec3i ResolutionFor(const SceneBox& box, int longest);

}  // namespace regrade
