#include "reconstruct/views/scene_up.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "kernels/base/quantile.h"
#include "kernels/splats/covariance.h"
#include "reconstruct/views/scene_extent.h"

namespace regrade {
namespace {

constexpr double kFlat = 0.4;                    // thickness over the next axis
const double kNearWay = std::cos(0.52);          // 30 degrees: of the first mean
const double kOnPlane = std::cos(0.21);          // 12 degrees
constexpr double kShareOfGround = 0.09;          // 4 times that of axes in all directions
constexpr double kFewestOnGround = 0.03;         // of all opaque splats
constexpr double kLow = 0.35, kMostTilt = 0.82;  // quantile of heights; cosine of 35 degrees

struct FlatSplat {
  Vec3d mean, axis;
  double weight;
};

Vec3d AxisOf(const Splat<float>& splat, int axis) {
  float q[4];
  UnitQuaternion(splat.quaternion, q);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  if (axis == 0) return {1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  if (axis == 1) return {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  return {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

std::vector<FlatSplat> FlatSplats(const SplatsView<float>& splats) {
  std::vector<FlatSplat> flat;
  std::vector<double> areas;
  for (int64_t i = 0; i < splats.count; ++i) {
    if (splats.opacity_logit[i] < kOpaqueLogit) continue;
    const Splat<float> splat = splats[i];
    int order[3] = {0, 1, 2};
    std::ranges::sort(order, {}, [&](int a) { return splat.log_scale[a]; });
    const double thin = splat.log_scale[order[0]], middle = splat.log_scale[order[1]];
    if (thin - middle > std::log(kFlat)) continue;
    const double area = std::exp(std::min(80.0, middle + splat.log_scale[order[2]]));
    areas.push_back(area);
    flat.push_back({splat.mean.Cast<double>(), AxisOf(splat, order[0]), area});
  }
  const double most = Quantile(areas, 0.9);  // a few huge ones do not decide
  for (FlatSplat& splat : flat) splat.weight = std::min(splat.weight, most);
  return flat;
}

Vec3d MeanAxis(const std::vector<FlatSplat>& flat, Vec3d way, double cosine) {
  for (int i = 0; i < 5; ++i) {
    Vec3d sum;
    for (const FlatSplat& splat : flat) {
      const double along = Dot(splat.axis, way);
      if (std::abs(along) >= cosine) sum += splat.axis * std::copysign(splat.weight, along);
    }
    if (!(Norm(sum) > 0)) break;
    way = Normalized(sum);
  }
  return way;
}

// The direction up of a ground near `way`, where there is one.
std::optional<Vec3d> GroundNear(const std::vector<FlatSplat>& flat, const Splats& splats,
                                const Vec3d& way) {
  const Vec3d up = MeanAxis(flat, MeanAxis(flat, way, kNearWay), kOnPlane);
  if (Dot(up, way) < kMostTilt) return std::nullopt;
  std::vector<double> ground, all;
  double on_plane = 0, total = 0;
  for (const FlatSplat& splat : flat) {
    total += splat.weight;
    if (std::abs(Dot(splat.axis, up)) < kOnPlane) continue;
    on_plane += splat.weight;
    ground.push_back(Dot(splat.mean, up));
  }
  for (int64_t i = 0; i < splats.count(); ++i)
    if (splats.opacity_logit[static_cast<size_t>(i)] >= kOpaqueLogit)
      all.push_back(Dot(splats.view()[i].mean.Cast<double>(), up));
  if (static_cast<double>(ground.size()) < kFewestOnGround * static_cast<double>(all.size()) ||
      on_plane < kShareOfGround * total || Median(ground) > Quantile(all, kLow))
    return std::nullopt;
  return up;
}

}  // namespace

SceneUp EstimateUp(const Splats& splats) {
  const std::vector<FlatSplat> flat = FlatSplats(splats.view());
  struct Convention {
    Vec3d up;
    const char* why;
  };
  const Convention conventions[] = {
      {{0, -1, 0}, "up is -y, turned to the ground"},
      {{0, 0, 1}, "up is z, turned to the ground"},
      {{0, 1, 0}, "up is y, turned to the ground"},
  };
  for (const auto& [way, why] : conventions)
    if (const auto up = GroundNear(flat, splats, way)) return {*up, why};
  return {{0, -1, 0}, "up is taken to be -y: there is no ground to tell (--up overrides)"};
}

}  // namespace regrade
