#include "reconstruct/colmap/far_cameras.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "kernels/base/quantile.h"

namespace regrade {
namespace {

constexpr double kFarTimes = 50;
constexpr double kMostFar = 0.25;  // of the images
constexpr int kFewestObservations = 10;
constexpr double kMostError = 0.01;  // of the picture's longer side

bool ConfirmedByPoints(const ColmapModel& model, const ColmapImage& image) {
  const Camera camera = model.CameraOf(image);
  int observations = 0, right = 0;
  for (const ColmapKeypoint& keypoint : image.keypoints) {
    const ColmapPoint* const point = model.FindPoint(keypoint.point_id);
    if (point == nullptr) continue;
    ++observations;
    double u = 0, v = 0;
    right += camera.Project(point->position, &u, &v) &&
             std::hypot(u - keypoint.u, v - keypoint.v) <=
                 kMostError * std::max(camera.width, camera.height);
  }
  return right >= kFewestObservations && 2 * right >= observations;
}

// Distances of the images' cameras from their middle, over the median one; empty where that
// is 0.
std::vector<double> RelativeDistances(const ColmapModel& model) {
  std::vector<Vec3d> centers;
  for (const ColmapImage& image : model.images)
    centers.push_back(image.camera_from_world.Inverse().translation);
  Vec3d middle;
  for (int a = 0; a < 3; ++a) {
    std::vector<double> along;
    for (const Vec3d& center : centers) along.push_back(center[a]);
    middle[a] = Median(std::move(along));
  }
  std::vector<double> distances;
  for (const Vec3d& center : centers) distances.push_back(Norm(center - middle));
  const double median = Median(distances);
  if (!(median > 0)) return {};
  for (double& distance : distances) distance /= median;
  return distances;
}

}  // namespace

std::vector<FarCamera> TakeOutFarCameras(ColmapModel* model) {
  std::vector<FarCamera> far;
  const std::vector<double> distances = RelativeDistances(*model);
  std::set<uint32_t> out;
  for (size_t i = 0; i < distances.size(); ++i) {
    const ColmapImage& image = model->images[i];
    if (!(distances[i] > kFarTimes) || ConfirmedByPoints(*model, image)) continue;
    far.push_back({image.name, distances[i]});
    out.insert(image.id);
  }
  if (static_cast<double>(far.size()) > kMostFar * static_cast<double>(distances.size()))
    return {};
  if (far.empty()) return far;
  std::erase_if(model->images,
                [&](const ColmapImage& image) { return out.contains(image.id); });
  for (ColmapPoint& point : model->points)
    std::erase_if(point.track, [&](const ColmapTrackElement& element) {
      return out.contains(element.image_id);
    });
  return far;
}

}  // namespace regrade
