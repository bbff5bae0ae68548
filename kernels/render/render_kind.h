// The renderer and the weigher of each kind of field.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "kernels/device/backend.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Of one processor; see FieldRenderer, which owns one.
class Renderer {
 public:
  virtual ~Renderer() = default;
  virtual RenderedView Render(const Camera& camera) const = 0;
  virtual RenderedPair RenderWith(const Renderer& other, const Camera& camera) const = 0;
};

struct RenderKind {
  std::unique_ptr<Renderer> (*make_renderer)(const RadianceField& field, Backend backend);
  // The same of a field that is not needed any more, without a copy.
  std::unique_ptr<Renderer> (*take_field)(RadianceField&& field, Backend backend);
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
