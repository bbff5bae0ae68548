// Plain rendering: one body a pixel, on either processor.
#include <algorithm>
#include <vector>

#include "kernels/field/ray_loss.h"
#include "kernels/field/render.h"

namespace regrade {
namespace {

struct RenderPixel {
  FieldView<float> field;
  MarchOptions options;
  const Ray* rays;
  float* color;
  float* depth;
  float* transmittance;

  HD void operator()(int64_t i) const {
    const RayResult<float> result = RenderRay(field, rays[i], options);
    for (int c = 0; c < 3; ++c) color[3 * i + c] = result.color[c];
    depth[i] = result.depth;
    transmittance[i] = result.transmittance;
  }
};

// Depth along the optical axis of the point at `length` along a ray in NDC. Infinity is set at
// z = 1e4 near planes.
float NdcDepth(const Camera& camera, const Ray& ray, float length) {
  Vec3d p = (ray.origin + ray.direction * length).Cast<double>();
  p.z = std::min(p.z, 1 - 2e-4);
  return static_cast<float>((camera.camera_from_world * WorldFromNdc(camera.ndc, p)).z);
}

}  // namespace

RenderedView RenderViewPlain(const RadianceField& field, const Camera& camera,
                             const MarchOptions& options, Backend backend) {
  std::vector<Ray> rays;
  rays.reserve(static_cast<size_t>(camera.width) * camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) rays.push_back(camera.PixelRay(x, y));
  RenderedView view{Image(camera.width, camera.height, 3),
                    Image(camera.width, camera.height, 1),
                    Image(camera.width, camera.height, 1)};
  ForEach(backend, "render_pixel", static_cast<int64_t>(rays.size()),
          RenderPixel{ViewOf(field), options, rays.data(), view.color.pixels.data(),
                      view.depth.pixels.data(), view.transmittance.pixels.data()});
  FinishView(camera, rays, &view);
  return view;
}

void FinishView(const Camera& camera, const std::vector<Ray>& rays, RenderedView* view) {
  const Vec3f forward = camera.Forward().Cast<float>();
  for (size_t i = 0; i < rays.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      float& value = view->color.pixels[3 * i + c];
      value = std::clamp(value, 0.0f, 1.0f);
    }
    const float opaque = 1.0f - view->transmittance.pixels[i];
    float& depth = view->depth.pixels[i];
    if (!(opaque >= 0.5f))
      depth = 0;
    else if (camera.ndc.on())
      depth = NdcDepth(camera, rays[i], depth / opaque);
    else
      depth = depth / opaque * Dot(rays[i].direction, forward);
  }
}

}  // namespace regrade
