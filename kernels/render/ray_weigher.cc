#include "kernels/render/ray_weigher.h"

#include "kernels/render/render_kind.h"

namespace regrade {

std::unique_ptr<RayWeigher> MakeRayWeigher(const Geometry& geometry, float near_clip,
                                           const MarchOptions& march, float min_weight,
                                           int64_t kept_bytes) {
  auto weigher = RenderKindOf(geometry).make_weigher(geometry, near_clip, march, kept_bytes);
  weigher->min_weight = min_weight;
  return weigher;
}

std::vector<double> RayDepths(const RadianceField& field, const ViewRays& rays,
                              RayWeigher* weigher) {
  return RenderKindOf(*field.geometry).ray_depths(field, rays, weigher);
}

}  // namespace regrade
