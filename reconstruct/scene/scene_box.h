// The modelled box in the field's frame, and the resolution of its grid.
#pragma once

#include <optional>

#include "kernels/base/vec.h"

namespace regrade {

struct SceneBox {
  Vec3f center{0, 0, 0};
  Vec3f radius{1, 1, 1};
  float near_clip = 0;  // nothing is modelled nearer to a camera than this
  int layers = 0;       // limit of vertices along z; 0: proportional to the radius
  // Height (y) of a voxel over its width (x), in the box's units: 1 except in NDC, where a
  // picture is as high as wide.
  float voxel_aspect = 1;
  std::optional<Vec3f> background;  // sRGB behind everything; default: the photos' mean colour
  // Fits what is far outside of the box: voxels on spheres, splats from far starts.
  bool far_surroundings = false;
};

// Vertices per axis, `longest` on the longest side; voxels are cubes up to rounding. With
// `layers`, z has at most that many, and a voxel is as many pixels wide as high.
Vec3i ResolutionFor(const SceneBox& box, int longest);

}  // namespace regrade
