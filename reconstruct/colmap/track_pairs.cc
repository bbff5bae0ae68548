#include "reconstruct/colmap/track_pairs.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace regrade {
namespace {

// Photos that look more than this apart hardly show the same side of anything.
constexpr double kWidestAngle = 75 * M_PI / 180;
// As far apart as these are, matches get rare; a distance counts as a share of the largest.
constexpr double kAngleScale = 30 * M_PI / 180, kDistanceScale = 0.25;
// Places in the order of nearness.
constexpr size_t kRanks[kPartners] = {0, 1, 2, 4, 7, 12};

}  // namespace

std::vector<std::pair<size_t, size_t>> PairsWorthMatching(const std::vector<Camera>& cameras) {
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
  double spread = 0;
  for (const Vec3d& a : centers)
    for (const Vec3d& b : centers) spread = std::max(spread, Norm(a - b));
  for (size_t i = 0; i < n; ++i) {
    std::vector<std::pair<double, size_t>> by_distance;
    for (size_t j = 0; j < n; ++j) {
      if (j == i) continue;
      const double angle = std::acos(std::clamp(Dot(forwards[i], forwards[j]), -1.0, 1.0));
      if (angle > kWidestAngle) continue;
      const double apart = spread > 0 ? Norm(centers[i] - centers[j]) / spread : 0;
      by_distance.emplace_back(std::hypot(apart / kDistanceScale, angle / kAngleScale), j);
    }
    std::sort(by_distance.begin(), by_distance.end());
    for (const size_t rank : kRanks)
      if (rank < by_distance.size()) pairs.insert(std::minmax(i, by_distance[rank].second));
  }
  return {pairs.begin(), pairs.end()};
}

}  // namespace regrade
