// Rays through places of pictures: voxels are marched along the ray, splats are blended at the
// place.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/scene/camera.h"

namespace regrade {

// A point of a camera's picture; pixel (x, y) has its centre at (x + 0.5, y + 0.5).
struct ViewPlace {
  int32_t camera;  // index
  double u, v;     // pixels
};

struct ViewRays {
  std::vector<Camera> cameras;
  std::vector<Ray> rays;          // in the field's space, see Camera::FieldRay
  std::vector<ViewPlace> places;  // [rays]

  int64_t size() const { return std::ssize(rays); }
  const Camera& CameraOf(int64_t ray) const {
    return cameras[static_cast<size_t>(places[static_cast<size_t>(ray)].camera)];
  }
  void Add(int32_t camera, double u, double v) {
    rays.push_back(cameras[static_cast<size_t>(camera)].FieldRay(u, v));
    places.push_back({camera, u, v});
  }
  void AddPixel(int32_t camera, int x, int y) { Add(camera, x + 0.5, y + 0.5); }
};

// Whether two cameras have the same rays.
inline bool SameView(const Camera& a, const Camera& b) {
  const RigidTransform &p = a.camera_from_world, &q = b.camera_from_world;
  for (int i = 0; i < 3; ++i)
    if (!(p.rotation.row[i] == q.rotation.row[i])) return false;
  return p.translation == q.translation && a.SameIntrinsics(b);
}

}  // namespace regrade
