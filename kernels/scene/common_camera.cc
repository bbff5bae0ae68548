#include "kernels/scene/common_camera.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "kernels/base/error.h"
#include "kernels/base/quantile.h"

namespace regrade {
namespace {

bool IsPortrait(const Camera& camera) { return camera.height > camera.width; }

bool IsNarrower(const Camera* a, const Camera* b) {
  return static_cast<int64_t>(a->width) * b->height <
         static_cast<int64_t>(b->width) * a->height;
}

// The cameras with the orientation of the majority.
std::vector<const Camera*> OfMainOrientation(const std::vector<Camera>& cameras) {
  const size_t portraits = static_cast<size_t>(std::ranges::count_if(cameras, IsPortrait));
  const bool portrait = 2 * portraits > cameras.size();
  std::vector<const Camera*> chosen;
  for (const Camera& camera : cameras)
    if (IsPortrait(camera) == portrait) chosen.push_back(&camera);
  return chosen;
}

}  // namespace

bool HaveSameIntrinsics(const std::vector<Camera>& cameras) {
  return std::ranges::all_of(
      cameras, [&](const Camera& camera) { return camera.SameIntrinsics(cameras[0]); });
}

Camera CommonCamera(const std::vector<Camera>& cameras) {
  REGRADE_CHECK(!cameras.empty());
  Camera common = cameras[0].Undistorted();
  if (!HaveSameIntrinsics(cameras)) {
    std::vector<const Camera*> candidates = OfMainOrientation(cameras);
    std::vector<double> aspects, focals;
    for (const Camera* camera : candidates) aspects.push_back(camera->fy / camera->fx);
    for (const Camera& camera : cameras)
      focals.push_back(std::sqrt(camera.fx * camera.fy) /
                       std::max(camera.width, camera.height));
    std::ranges::stable_sort(candidates, IsNarrower);
    const Camera* middle = candidates[(candidates.size() - 1) / 2];
    const Camera* shape =
        *std::lower_bound(candidates.begin(), candidates.end(), middle, IsNarrower);
    common.width = shape->width;
    common.height = shape->height;
    const double focal = Median(focals) * std::max(common.width, common.height);
    double aspect = Median(aspects);
    if (std::abs(aspect - 1) <= kSquarePixels) aspect = 1;
    common.fx = focal / std::sqrt(aspect);
    common.fy = focal * std::sqrt(aspect);
  }
  common.cx = 0.5 * common.width;
  common.cy = 0.5 * common.height;
  return common;
}

std::vector<Camera> WithCommonIntrinsics(const std::vector<Camera>& cameras) {
  if (HaveSameIntrinsics(cameras)) return cameras;
  const Camera common = CommonCamera(cameras);
  std::vector<Camera> result(cameras.size(), common);
  for (size_t i = 0; i < cameras.size(); ++i)
    result[i].camera_from_world = cameras[i].camera_from_world;
  return result;
}

}  // namespace regrade
