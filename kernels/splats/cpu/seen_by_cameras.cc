#include "kernels/splats/cpu/seen_by_cameras.h"

#include "kernels/base/error.h"
#include "kernels/splats/seen_splat.h"

namespace regrade {

std::vector<uint8_t> SeenSplats(const SplatsView<float>& splats,
                                const std::vector<Camera>& cameras,
                                const SplatOptions& options) {
  std::vector<SplatCamera> views;
  for (Camera camera : cameras) {
    REGRADE_CHECK(camera.lens == LensModel::kPinhole);
    camera.ndc = {};  // splats are in the world
    views.emplace_back(camera);
  }
  SplatsView<float> shapes = splats;
  shapes.basis = 0;
  std::vector<uint8_t> seen(static_cast<size_t>(splats.count));
#pragma omp parallel for schedule(dynamic, 4096)
  for (int64_t i = 0; i < splats.count; ++i) {
    uint8_t& found = seen[static_cast<size_t>(i)];
    SeenSplat<float> as_seen;
    for (size_t v = 0; v < views.size() && found == 0; ++v)
      if (SeeSplat(views[v], options, shapes, i, &as_seen) &&
          !ExtentOf(views[v], as_seen.ellipse, as_seen.reach).empty())
        found = 1;
  }
  return seen;
}

}  // namespace regrade
