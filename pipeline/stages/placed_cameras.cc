#include "pipeline/stages/placed_cameras.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/fields/camera_path.h"
#include "reconstruct/views/place_views.h"
#include "reconstruct/views/scene_up.h"

namespace regrade {
namespace {

Vec3d UpOf(const std::string& word) {
  Vec3d up;
  up[word.back() - 'x'] = word.front() == '-' ? -1 : 1;
  return up;
}

}  // namespace

std::vector<BareCamera> PlacedCameras(const Splats& splats, const RadianceField& field,
                                      Backend backend, const std::string& up, int longest,
                                      const std::string& where, Console* console,
                                      const ProgressFunction& progress) {
  const SceneUp chosen =
      up == "auto" ? EstimateUp(splats) : SceneUp{UpOf(up), "up is " + up + " by --up"};
  console->Info(chosen.why);
  const PlacedViews placed =
      PlaceViews(splats, field, backend, chosen.up, longest, where, progress);
  console->Info(placed.summary);
  std::vector<BareCamera> cameras;
  for (const int i : SmoothOrder(placed.cameras))
    cameras.push_back(
        {Format("view%02zu.png", cameras.size()), placed.cameras[static_cast<size_t>(i)]});
  return cameras;
}

Camera ReducedTo(double longest, const Camera& camera) {
  const double scale = std::min(1.0, longest / std::max(camera.width, camera.height));
  return camera.Resized(std::max(1, static_cast<int>(std::lround(camera.width * scale))),
                        std::max(1, static_cast<int>(std::lround(camera.height * scale))));
}

}  // namespace regrade
