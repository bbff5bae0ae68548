#include "reconstruct/refinement/exposure_folds.h"

#include <algorithm>
#include <numeric>

namespace regrade {
namespace {

using Members = std::vector<size_t>;

int WidestAxis(const std::vector<Vec3d>& positions, const Members& members) {
  int widest = 0;
  double most = -1;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const size_t i : members) values.push_back(positions[i][axis]);
    std::ranges::sort(values);
    const double width = values[values.size() * 9 / 10] - values[values.size() / 10];
    if (width > most) most = width, widest = axis;
  }
  return widest;
}

void Split(const std::vector<Vec3d>& positions, Members members, int levels, int number,
           std::vector<int>* folds) {
  if (levels == 0 || members.size() < 2) {
    for (const size_t i : members) (*folds)[i] = number << levels;
    return;
  }
  const int axis = WidestAxis(positions, members);
  std::ranges::sort(members, [&](size_t i, size_t j) {
    for (int k = 0; k < 3; ++k) {
      const double a = positions[i][(axis + k) % 3], b = positions[j][(axis + k) % 3];
      if (a != b) return a < b;
    }
    return i < j;
  });
  const auto middle = members.begin() + static_cast<long>(members.size() / 2);
  Split(positions, {members.begin(), middle}, levels - 1, 2 * number, folds);
  Split(positions, {middle, members.end()}, levels - 1, 2 * number + 1, folds);
}

}  // namespace

std::vector<int> SpatialFolds(const std::vector<Vec3d>& positions, int levels) {
  std::vector<int> folds(positions.size());
  Members all(positions.size());
  std::iota(all.begin(), all.end(), size_t{0});
  Split(positions, all, levels, 0, &folds);
  return folds;
}

}  // namespace regrade
