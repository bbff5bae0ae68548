#include "kernels/synthetic/solid_index.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace regrade {
namespace {

Box BoxAround(const Vec3d& center, const Vec3d& half) { return {center - half, center + half}; }

Box BoundsOf(const Solid& solid) {
  const Vec3d& half = solid.half;
  const double cosine = std::abs(solid.cos_yaw), sine = std::abs(solid.sin_yaw);
  switch (solid.shape) {
    case Shape::kSphere:
      return BoxAround(solid.center, {half.x, half.x, half.x});
    case Shape::kBox:
      return BoxAround(solid.center, {cosine * half.x + sine * half.y,
                                      sine * half.x + cosine * half.y, half.z});
    case Shape::kCylinder:
    case Shape::kBackdrop:
      break;
  }
  return BoxAround(solid.center, {half.x, half.x, half.z});
}

Box ReachOf(const Solid& solid) {
  const double reach = ContactReach(solid);
  return BoxAround(solid.center, {reach, reach, reach});
}

std::vector<int> All(const std::vector<Solid>& solids) {
  std::vector<int> indices(solids.size());
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

std::vector<int> Those(const std::vector<Solid>& solids, bool (*chosen)(const Solid&)) {
  std::vector<int> indices = All(solids);
  std::erase_if(indices, [&](int i) { return !chosen(solids[i]); });
  return indices;
}

std::vector<Box> BoxesOf(const std::vector<Solid>& solids, const std::vector<int>& indices,
                         Box (*box_of)(const Solid&)) {
  std::vector<Box> boxes;
  for (const int i : indices) boxes.push_back(box_of(solids[i]));
  return boxes;
}

}  // namespace

SolidIndex::SolidIndex(const std::vector<Solid>& solids)
    : solids_(solids),
      tree_(BoxesOf(solids, All(solids), BoundsOf)),
      shadow_casters_(Those(solids, [](const Solid& s) { return s.casts_shadow; })),
      small_(Those(solids, [](const Solid& s) { return ContactReach(s) > 0; })),
      shadow_tree_(BoxesOf(solids, shadow_casters_, BoundsOf)),
      reaches_(BoxesOf(solids, small_, ReachOf)) {}

Hit SolidIndex::FindHit(const RayT<double>& ray, double min_distance) const {
  double best = std::numeric_limits<double>::infinity();
  int index = -1;
  tree_.AlongRay(ray, best, [&](int i) {
    const double t = HitDistance(solids_[i], ray, min_distance);
    // Of solids at the same distance, the first.
    if (t < best || (t == best && i < index)) best = t, index = i;
    return best;
  });
  return HitOf(solids_, index, ray, best);
}

bool SolidIndex::IsShadowed(const RayT<double>& ray, double min_distance) const {
  constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  bool shadowed = false;
  shadow_tree_.AlongRay(ray, kNoLimit, [&](int k) {
    shadowed = HitDistance(solids_[shadow_casters_[k]], ray, min_distance) < kNoLimit;
    return shadowed ? -1.0 : kNoLimit;
  });
  return shadowed;
}

std::vector<int> SolidIndex::ThoseInReach(const Vec3d& point) const {
  std::vector<int> found = reaches_.Around(point);
  for (int& i : found) i = small_[i];
  return found;
}

}  // namespace regrade
