#include "kernels/field/field_seen_by.h"

#include "kernels/base/error.h"
#include "kernels/field/direction_to_vertex.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/scene/pinhole_rays.h"

namespace regrade {

RadianceField FieldSeenBy(const RadianceField& field, const Camera& camera) {
  const Geometry& geometry = *field.geometry;
  REGRADE_CHECK(geometry.cells.on() && camera.lens == LensModel::kPinhole);
  const PinholeRays rays(camera);
  const int basis = field.appearance.basis;
  RadianceField seen{field.geometry, {}, field.background, field.near_clip, field.step};
  seen.appearance.basis = 1;
  seen.appearance.sphere_color = field.appearance.sphere_color;
  seen.appearance.sh.Resize(3 * geometry.num_voxels());
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < geometry.num_voxels(); ++v) {
    float gamma[kMaxBasis];
    ShBasis(basis, DirectionToVertex(geometry.frame, geometry.cells.vertex_key[v], rays),
            gamma);
    for (int c = 0; c < 3; ++c) {
      const float* const k = field.appearance.sh.data() + (3 * v + c) * basis;
      float sum = 0;
      for (int j = 0; j < basis; ++j) sum += k[j] * gamma[j];
      seen.appearance.sh[3 * v + c] = sum / static_cast<float>(kSh0);
    }
  }
  return seen;
}

}  // namespace regrade
