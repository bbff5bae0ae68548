#include "reconstruct/refinement/exposure_folds.h"

#include <algorithm>
#include <numeric>

namespace regrade {
namespace {

using Members = std::vector<size_t>;

int WidestAxis(const std::vector<Vec3d>& places, const Members& members) {
  int widest = 0;
  double most = -1;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const size_t i : members) values.push_back(places[i][axis]);
    std::sort(values.begin(), values.end());
    const double width = values[values.size() * 9 / 10] - values[values.size() / 10];
    if (width > most) most = width, widest = axis;
  }
  return widest;
}

void Split(const std::vector<Vec3d>& places, Members members, int levels, int number,
           std::vector<int>* folds) {
  if (levels == 0 || members.size() < 2) {
    for (const size_t i : members) (*folds)[i] = number << levels;
    return;
  }
  const int axis = WidestAxis(places, members);
  std::sort(members.begin(), members.end(), [&](size_t i, size_t j) {
    for (int k = 0; k < 3; ++k) {
      const double a = places[i][(axis + k) % 3], b = places[j][(axis + k) % 3];
      if (a != b) return a < b;
    }
    return i < j;
  });
  const auto middle = members.begin() + static_cast<long>(members.size() / 2);
  Split(places, {members.begin(), middle}, levels - 1, 2 * number, folds);
  Split(places, {middle, members.end()}, levels - 1, 2 * number + 1, folds);
}

}  // namespace

std::vector<int> SpatialFolds(const std::vector<Vec3d>& places, int levels) {
  std::vector<int> folds(places.size());
  Members all(places.size());
  std::iota(all.begin(), all.end(), size_t{0});
  Split(places, all, levels, 0, &folds);
  return folds;
}

}  // namespace regrade
