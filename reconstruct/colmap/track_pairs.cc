#include "reconstruct/colmap/track_pairs.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

// Photos at a larger angle hardly show the same surfaces.
constexpr double kWidestAngle = 75 * M_PI / 180;
// Scales at which matches become rare; distances are fractions of the largest.
constexpr double kAngleScale = 30 * M_PI / 180, kDistanceScale = 0.25;
// Ranks in the order of distance.
constexpr size_t kRanks[kPartners] = {0, 1, 2, 4, 7, 12};

}  // namespace

std::vector<std::pair<size_t, size_t>> PairsToMatch(const std::vector<Camera>& cameras) {
  const size_t n = cameras.size();
  std::set<std::pair<size_t, size_t>> pairs;
  if (n <= 2 * kPartners) {
    for (size_t i = 0; i < n; ++i)
      for (size_t j = i + 1; j < n; ++j) pairs.emplace(i, j);
    return {pairs.begin(), pairs.end()};
  }
  std::vector<Vec3d> centers, forwards;
  for (const Camera& camera : cameras) {
    centers.push_back(camera.Center());
    forwards.push_back(camera.Forward());
  }
  const double extent = LargestDistance(centers);
  for (size_t i = 0; i < n; ++i) {
    std::vector<std::pair<double, size_t>> by_distance;
    for (size_t j = 0; j < n; ++j) {
      if (j == i) continue;
      const double angle = std::acos(std::clamp(Dot(forwards[i], forwards[j]), -1.0, 1.0));
      if (angle > kWidestAngle) continue;
      const double apart = extent > 0 ? Norm(centers[i] - centers[j]) / extent : 0;
      by_distance.emplace_back(std::hypot(apart / kDistanceScale, angle / kAngleScale), j);
    }
    std::ranges::sort(by_distance);
    for (const size_t rank : kRanks)
      if (rank < by_distance.size()) pairs.insert(std::minmax(i, by_distance[rank].second));
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace regrade
