// Plain rendering, pixel by pixel.
#include <vector>

#include "kernels/field/render.h"
#include "kernels/field/render_ray.h"
#include "kernels/field/resolve_pixel.h"

namespace regrade {

RenderedView RenderViewPlain(const RadianceField& field, const Camera& camera,
                             const MarchOptions& options) {
  std::vector<Ray> rays;
  rays.reserve(static_cast<size_t>(camera.width) * camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) rays.push_back(camera.PixelRay(x, y));
  RenderedView view{Image(camera.width, camera.height, 3),
                    Image(camera.width, camera.height, 1),
                    Image(camera.width, camera.height, 1)};
  const FieldView<float> plain = ViewOf(field);
#pragma omp parallel for schedule(dynamic, 64)
  for (int64_t i = 0; i < static_cast<int64_t>(rays.size()); ++i) {
    const RayResult<float> result = RenderRay(plain, rays[static_cast<size_t>(i)], options);
    for (int c = 0; c < 3; ++c)
      view.color.pixels[static_cast<size_t>(3 * i + c)] = result.color[c];
    view.depth.pixels[static_cast<size_t>(i)] = result.depth;
    view.transmittance.pixels[static_cast<size_t>(i)] = result.transmittance;
  }
  FinishView(camera, rays, &view);
  return view;
}

void FinishView(const Camera& camera, const std::vector<Ray>& rays, RenderedView* view) {
  const ResolvePixel resolve(camera);
  for (size_t i = 0; i < rays.size(); ++i) {
    float* pixel = &view->color.pixels[3 * i];
    Vec3f color{pixel[0], pixel[1], pixel[2]};
    resolve(rays[i], view->transmittance.pixels[i], &color, &view->depth.pixels[i]);
    for (int c = 0; c < 3; ++c) pixel[c] = color[c];
  }
}

}  // namespace regrade
