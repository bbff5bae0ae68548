#include "pipeline/capture/synth_model.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "pipeline/capture/synth_effects.h"

namespace regrade {
namespace {

constexpr double kSameDepth = 0.01;  // of the depth: a larger difference is an occluder

// Box and Muller 1958; 1 - u is in (0, 1].
double Normal(uint64_t seed, uint64_t stream, uint64_t counter) {
  return std::sqrt(-2 *
                   std::log(1 - RandomDouble(seed ^ kRandomSynthModel, stream, 2 * counter))) *
         std::cos(2 * M_PI * RandomDouble(seed ^ kRandomSynthModel, stream, 2 * counter + 1));
}

Vec3d Direction(uint64_t seed, uint64_t stream, uint64_t counter) {
  return Normalized(Vec3d{Normal(seed, stream, counter), Normal(seed, stream + 1, counter),
                          Normal(seed, stream + 2, counter)});
}

// Rotation about a unit axis (Rodrigues' formula).
Mat3d RotationAbout(const Vec3d& axis, double angle) {
  Mat3d rotation;
  for (int i = 0; i < 3; ++i) {
    Vec3d unit;
    unit[i] = 1;
    const Vec3d column = unit * std::cos(angle) + Cross(axis, unit) * std::sin(angle) +
                         axis * (Dot(axis, unit) * (1 - std::cos(angle)));
    for (int j = 0; j < 3; ++j) rotation(j, i) = column[j];
  }
  return rotation;
}

// Adds the point and its keypoints in the views that see it; omits points with fewer than two.
void AddTrack(const std::vector<Camera>& cameras, const std::vector<Image>& depths,
              const Vec3d& position, uint64_t seed, ColmapModel* model) {
  ColmapPoint point{model->points.size() + 1, position, {128, 128, 128}, 0, {}};
  std::vector<ColmapKeypoint> keypoints;
  for (size_t v = 0; v < cameras.size(); ++v) {
    const Camera& camera = cameras[v];
    double x = 0, y = 0, z = 0;
    if (!camera.Project(position, &x, &y, &z)) continue;
    if (!(x >= 0 && y >= 0 && x < camera.width && y < camera.height)) continue;
    const double there = *depths[v].at(static_cast<int>(x), static_cast<int>(y));
    if (!(std::abs(there - z) < kSameDepth * z)) continue;
    const uint64_t counter = point.id * cameras.size() + v;
    point.track.push_back({model->images[v].id, 0});
    keypoints.push_back({x + kSynthTrackSigma * Normal(seed, 0, counter),
                         y + kSynthTrackSigma * Normal(seed, 1, counter), point.id});
  }
  if (keypoints.size() < 2) return;
  for (size_t k = 0; k < keypoints.size(); ++k) {
    ColmapImage& image = model->images[point.track[k].image_id - 1];
    point.track[k].keypoint = static_cast<uint32_t>(image.keypoints.size());
    image.keypoints.push_back(keypoints[k]);
  }
  model->points.push_back(point);
}

}  // namespace

ColmapModel TracksOf(const std::vector<Camera>& cameras, const std::vector<Image>& depths,
                     const std::vector<std::string>& names, uint64_t seed) {
  ColmapModel model;
  if (cameras.empty()) return model;
  for (size_t v = 0; v < cameras.size(); ++v) {
    const auto known = std::ranges::find_if(model.cameras, [&](const ColmapCamera& camera) {
      return camera.intrinsics.SameIntrinsics(cameras[v]);
    });
    const uint32_t id = static_cast<uint32_t>(known - model.cameras.begin()) + 1;
    if (known == model.cameras.end()) {
      model.cameras.push_back({id, ColmapLensOf(cameras[v].lens), cameras[v]});
      model.cameras.back().intrinsics.camera_from_world = {};
    }
    model.images.push_back(
        {static_cast<uint32_t>(v + 1), id, names[v], cameras[v].camera_from_world, {}});
  }
  for (size_t v = 0; v < cameras.size(); ++v) {
    const Camera& camera = cameras[v];
    const int step = std::max(
        1, static_cast<int>(std::sqrt(1.0 * camera.width * camera.height / kTracksPerView)));
    for (int y = step / 2; y < camera.height; y += step)
      for (int x = step / 2; x < camera.width; x += step) {
        const double depth = *depths[v].at(x, y);
        if (!(depth > 0)) continue;
        const RayT<double> ray = camera.WorldRay(x + 0.5, y + 0.5);
        AddTrack(cameras, depths,
                 ray.origin + ray.direction * (depth / Dot(ray.direction, camera.Forward())),
                 seed, &model);
      }
  }
  return model;
}

ColmapModel PerturbedModel(const ColmapModel& model, uint64_t seed) {
  ColmapModel perturbed = model;
  double extent = 0;
  for (const ColmapImage& a : model.images)
    for (const ColmapImage& b : model.images)
      extent = std::max(extent, Norm(a.camera_from_world.Inverse().translation -
                                     b.camera_from_world.Inverse().translation));
  for (ColmapImage& image : perturbed.images) {
    const Vec3d center = image.camera_from_world.Inverse().translation +
                         Direction(seed, 20, image.id) * (kSynthPoseStep * extent);
    const Mat3d rotation =
        RotationAbout(Direction(seed, 10, image.id), kSynthPoseTurn * M_PI / 180) *
        image.camera_from_world.rotation;
    image.camera_from_world = {rotation, -(rotation * center)};
  }
  return perturbed;
}

}  // namespace regrade
