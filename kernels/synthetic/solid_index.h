// Finds the solids that rays hit among thousands. The results are those of solid.h, bit by bit.
#pragma once

#include <vector>

#include "kernels/synthetic/box_tree.h"
#include "kernels/synthetic/solid.h"

namespace regrade {

class SolidIndex {
 public:
  // Refers to the solids, which must outlive it.
  explicit SolidIndex(const std::vector<Solid>& solids);

  // As the functions of these names.
  Hit FindHit(const RayT<double>& ray, double min_distance) const;
  bool IsShadowed(const RayT<double>& ray, double min_distance) const;

  // The solids that are at most their ContactReach away from the point, and maybe some others,
  // in ascending order.
  std::vector<int> ThoseInReach(const Vec3d& point) const;

 private:
  const std::vector<Solid>& solids_;
  BoxTree tree_;
  std::vector<int> shadow_casters_, small_;  // indices; small ones give contact shadows
  BoxTree shadow_tree_, reaches_;            // of these
};

}  // namespace regrade
