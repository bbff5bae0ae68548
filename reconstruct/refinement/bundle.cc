#include "reconstruct/refinement/bundle.h"

#include <ceres/rotation.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/base/quantile.h"
#include "kernels/base/random.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

constexpr double kHeldOutFraction = 0.1;
constexpr double kLeastExtent = 1e-4;  // of the points' distance: less shows no depth
constexpr size_t kLeastKept = 3;       // observations of a point that are not held out

Mat3d RotationOf(const double* angle_axis) {
  Mat3d rotation;
  ceres::AngleAxisToRotationMatrix(angle_axis, ceres::RowMajorAdapter3x3(&rotation(0, 0)));
  return rotation;
}

Vec3d CenterOf(const std::array<double, 6>& pose) { return {pose[3], pose[4], pose[5]}; }

double MedianDistance(const std::vector<ColmapPoint>& points, const Vec3d& from) {
  std::vector<double> distances;
  for (const ColmapPoint& point : points) distances.push_back(Norm(point.position - from));
  return Median(std::move(distances));
}

}  // namespace

Bundle MakeBundle(const ColmapModel& model) {
  Bundle bundle;
  std::vector<Vec3d> centers;
  std::map<uint32_t, size_t> view_of_image;
  std::vector<uint64_t> numbers;
  Vec3d mean;
  for (const ColmapImage& image : model.images) {
    view_of_image[image.id] = bundle.lenses.size();
    const ColmapCamera* const camera = model.FindCamera(image.camera_id);
    bundle.camera.push_back(static_cast<size_t>(camera - model.cameras.data()));
    Camera lens = camera->intrinsics;
    lens.camera_from_world = {};
    bundle.lenses.push_back(lens);
    bundle.rotations.push_back(image.camera_from_world.rotation);
    centers.push_back(image.camera_from_world.Inverse().translation);
    mean += centers.back() / static_cast<double>(model.images.size());
    numbers.push_back(HashOf(image.name));
  }
  bundle.focal.resize(model.cameras.size());
  double extent = LargestDistance(centers);
  if (extent < kLeastExtent * MedianDistance(model.points, mean)) extent = 0;
  const double scale = extent > 0 ? 1 / extent : 1;
  bundle.extent = extent > 0 ? 1 : 0;
  bundle.bundle_from_world = {scale, Mat3d(), -(mean * scale)};
  for (const Vec3d& center : centers) {
    const Vec3d c = bundle.bundle_from_world * center;
    bundle.poses.push_back({0, 0, 0, c.x, c.y, c.z});
  }

  for (size_t p = 0; p < model.points.size(); ++p) {
    const Vec3d x = bundle.bundle_from_world * model.points[p].position;
    bundle.points.push_back({x.x, x.y, x.z});
    std::vector<BundleObservation> seen;
    for (const ColmapTrackElement& element : model.points[p].track) {
      const ColmapImage& image = *model.FindImage(element.image_id);
      const ColmapKeypoint& keypoint = image.keypoints[element.keypoint];
      const BundleObservation observation{view_of_image.at(image.id), p, keypoint.u, keypoint.v,
                                          false};
      if (std::isfinite(ReprojectionError(bundle, observation))) seen.push_back(observation);
    }
    if (seen.size() < 2) continue;
    std::ranges::sort(seen, [&](const BundleObservation& a, const BundleObservation& b) {
      return numbers[a.view] < numbers[b.view];
    });
    size_t kept = seen.size();
    for (BundleObservation& observation : seen) {
      observation.held_out =
          kept > kLeastKept &&
          RandomDouble(numbers[observation.view], model.points[p].id, 0) < kHeldOutFraction;
      kept -= observation.held_out;
    }
    bundle.observations.insert(bundle.observations.end(), seen.begin(), seen.end());
  }
  std::vector<size_t> count(bundle.lenses.size());
  for (const BundleObservation& observation : bundle.observations)
    count[observation.view] += !observation.held_out;
  for (const size_t n : count) bundle.adjustable.push_back(n >= kFewestObservations);
  return bundle;
}

double ReprojectionError(const Bundle& bundle, const BundleObservation& observation) {
  const std::array<double, 6>& pose = bundle.poses[observation.view];
  const std::array<double, 3>& x = bundle.points[observation.point];
  const Vec3d rotated =
      bundle.rotations[observation.view] * (Vec3d{x[0], x[1], x[2]} - CenterOf(pose));
  const Camera& lens = bundle.lenses[observation.view];
  double u = 0, v = 0;
  if (!lens.Project(RotationOf(pose.data()) * rotated, &u, &v))
    return std::numeric_limits<double>::infinity();
  const double factor = std::exp(bundle.focal[bundle.camera[observation.view]]);
  return std::hypot((u - lens.cx) * factor + lens.cx - observation.u,
                    (v - lens.cy) * factor + lens.cy - observation.v);
}

double MedianError(const Bundle& bundle, bool held_out) {
  std::vector<double> errors;
  for (const BundleObservation& observation : bundle.observations)
    if (observation.held_out == held_out)
      errors.push_back(ReprojectionError(bundle, observation));
  return Median(std::move(errors));
}

ColmapModel ModelOfBundle(const Bundle& bundle, const ColmapModel& model) {
  REGRADE_CHECK_EQ(bundle.poses.size(), model.images.size());
  const size_t n = bundle.poses.size();
  std::vector<Mat3d> rotations;
  std::vector<Vec3d> before, after;
  Vec3d mean_before, mean_after;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t v = 0; v < n; ++v) {
    rotations.push_back(RotationOf(bundle.poses[v].data()) * bundle.rotations[v]);
    const Mat3d correction = bundle.rotations[v].Transposed() * rotations[v];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum(i, j) += correction(i, j);
    before.push_back(model.images[v].camera_from_world.Inverse().translation);
    after.push_back(CenterOf(bundle.poses[v]));
    mean_before += before[v] / static_cast<double>(n);
    mean_after += after[v] / static_cast<double>(n);
  }
  // The orthogonal matrix nearest to the sum of R_before^T R_after; its determinant is 1
  // because the corrections are small.
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  Similarity world_from_bundle;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) world_from_bundle.rotation(i, j) = nearest(i, j);
  double across = 0, along = 0;
  for (size_t v = 0; v < n; ++v) {
    const Vec3d rotated = world_from_bundle.rotation * (after[v] - mean_after);
    across += Dot(rotated, before[v] - mean_before);
    along += Dot(rotated, rotated);
  }
  world_from_bundle.scale = across / along;
  world_from_bundle.translation =
      mean_before - world_from_bundle.rotation * mean_after * world_from_bundle.scale;

  ColmapModel moved = model;
  for (size_t v = 0; v < n; ++v) {
    const Mat3d rotation = rotations[v] * world_from_bundle.rotation.Transposed();
    moved.images[v].camera_from_world = {rotation,
                                         -(rotation * (world_from_bundle * after[v]))};
  }
  for (size_t c = 0; c < bundle.focal.size(); ++c) {
    moved.cameras[c].intrinsics.fx *= std::exp(bundle.focal[c]);
    moved.cameras[c].intrinsics.fy *= std::exp(bundle.focal[c]);
  }
  std::vector<bool> in_bundle(model.points.size());
  for (const BundleObservation& observation : bundle.observations)
    in_bundle[observation.point] = true;
  for (size_t p = 0; p < model.points.size(); ++p) {
    const std::array<double, 3>& x = bundle.points[p];
    if (in_bundle[p]) moved.points[p].position = world_from_bundle * Vec3d{x[0], x[1], x[2]};
  }
  return moved;
}

}  // namespace regrade
