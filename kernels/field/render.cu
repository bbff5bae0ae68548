// Plain rendering: one body a pixel, on either processor.
#include <vector>

#include "kernels/field/finish_pixel.h"
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
  const FinishPixel finish(camera);
  for (size_t i = 0; i < rays.size(); ++i) {
    float* pixel = &view->color.pixels[3 * i];
    Vec3f color{pixel[0], pixel[1], pixel[2]};
    finish(rays[i], view->transmittance.pixels[i], &color, &view->depth.pixels[i]);
    for (int c = 0; c < 3; ++c) pixel[c] = color[c];
  }
}

}  // namespace regrade
