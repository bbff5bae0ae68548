// Makes renderers and weighers for each kind of field.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/device/backend.h"
#include "kernels/render/kind_renderer.h"
#include "kernels/render/ray_weigher.h"

namespace regrade {

struct RenderKind {
  std::unique_ptr<KindRenderer> (*make_renderer)(const RadianceField& field, Backend backend);
  // The same of a field that is not needed any more, without a copy.
  std::unique_ptr<KindRenderer> (*take_field)(RadianceField&& field, Backend backend);
  // See MakeRayWeigher, RayDepths and OpticalDepths.
  std::unique_ptr<RayWeigher> (*make_weigher)(const Geometry& geometry, float near_clip,
                                              const MarchOptions& march, int64_t kept_bytes);
  std::vector<double> (*ray_depths)(const RadianceField& field, const ViewRays& rays,
                                    RayWeigher* weigher);
  std::vector<double> (*optical_depths)(const RadianceField& field,
                                        const std::vector<Vec3d>& path);
};

const RenderKind& RenderKindOf(const Geometry& geometry);

}  // namespace regrade
