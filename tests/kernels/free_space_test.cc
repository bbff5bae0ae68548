// EQ(free-space): its derivative, its limits, and the CPU's fast path against it.
#include "kernels/field/free_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "tests/support/cell_field.h"
#include "tests/support/double_field.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using testing::RandomCellField;
using testing::RandomRays;
using testing::ToDouble;

struct Space {
  GridFrame frame;
  CellsView cells;
  std::vector<double> density;

  explicit Space(const RadianceField& field)
      : frame(field.geometry->frame),
        cells(ViewOf(field.geometry->cells, frame.resolution)),
        density(field.geometry->density.begin(), field.geometry->density.end()) {}
  double Opacity(const RayT<double>& ray, double length) const {
    return OpacityBefore(frame, cells, density.data(), ray, 0.0, length);
  }
  std::vector<double> Gradient(const RayT<double>& ray, double length, double scale) const {
    std::vector<double> gradient(density.size());
    OpacityBeforeAdjoint(frame, cells, density.data(), ray, 0.0, length, Opacity(ray, length),
                         scale,
                         [&](int32_t v, double d) { gradient[static_cast<size_t>(v)] += d; });
    return gradient;
  }
};

// Densities are far enough from 0 that a step of 1e-5 crosses no kink of OpticalDepth.
TEST(FreeSpace, H168_AdjointEqualsDerivativeInDoubleAcrossFaces) {
  const RadianceField field = RandomCellField({2, 2, 2}, 2, 1, 71);
  Space space(field);
  int checked = 0;
  for (const Ray& ray_f : RandomRays(60, 72)) {
    const RayT<double> ray = ToDouble(ray_f);
    const double length = 1.5;
    const std::vector<double> gradient = space.Gradient(ray, length, 1.0);
    for (size_t v = 0; v < gradient.size(); ++v) {
      if (gradient[v] == 0) continue;
      const double at = space.density[v], step = 1e-5;
      space.density[v] = at + step;
      const double up = space.Opacity(ray, length);
      space.density[v] = at - step;
      const double down = space.Opacity(ray, length);
      space.density[v] = at;
      EXPECT_NEAR((up - down) / (2 * step), gradient[v],
                  testing::RecordDigits("gradient of free space", testing::Computed::kDouble,
                                        (up - down) / (2 * step) - gradient[v], 1e-8,
                                        1 + std::abs(gradient[v])));
      ++checked;
    }
  }
  EXPECT_GT(checked, 100);
}

TEST(FreeSpace, H168_OnlyWhatIsBeforeTheLengthCounts) {
  const RadianceField field = RandomCellField({2, 2, 2}, 2, 1, 71);
  const Space space(field);
  int grown = 0;
  for (const Ray& ray_f : RandomRays(50, 73)) {
    const RayT<double> ray = ToDouble(ray_f);
    EXPECT_EQ(space.Opacity(ray, 0), 0);
    EXPECT_EQ(space.Opacity(ray, -1), 0);
    double before = 0;
    for (const double length : {0.5, 1.0, 2.0, 4.0, 1e30}) {
      const double opacity = space.Opacity(ray, length);
      EXPECT_GE(opacity, before);  // it grows with the length, and is an opacity
      EXPECT_LE(opacity, 1);
      before = opacity;
    }
    grown += space.Opacity(ray, 0.5) < space.Opacity(ray, 4);
  }
  EXPECT_GT(grown, 10);
}

// In float against double: 1e-4 of the largest entry, as gradients of rays.
TEST(FreeSpace, FastPathsEqualThePlainAdjoint) {
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    for (const int basis : {1, 4, 9}) {
      const RadianceField field = RandomCellField({3, 2, 2}, 2, basis, 74);
      FastGrid grid = MakeFastGrid(field);
      grid.near_clip = 0;
      const Space space(field);
      std::vector<FreeRay> rays;
      for (const Ray& ray : RandomRays(100, 75)) rays.push_back({ray, 1.7f});
      GradientArena arena;
      arena.Reset(grid.num_voxels());
      functions->free_space(grid, rays.data(), 100, 0.25f, &arena);
      std::vector<double> plain(space.density.size());
      for (const FreeRay& ray : rays) {
        const std::vector<double> one = space.Gradient(ToDouble(ray.ray), 1.7f, 0.25);
        for (size_t v = 0; v < plain.size(); ++v) plain[v] += one[v];
      }
      double largest = 0, worst = 0;
      for (int64_t v = 0; v < grid.num_voxels(); ++v) {
        const int32_t slot = arena.slot_of_voxel[v];
        for (int lane = 0; lane < grid.lanes(); ++lane) {
          const double fast =
              slot < 0 ? 0.0 : double{arena.gradient[int64_t{slot} * grid.lanes() + lane]};
          const double expected =
              lane == DensityLane(basis) ? plain[static_cast<size_t>(v)] : 0.0;
          largest = std::max(largest, std::abs(expected));
          worst = std::max(worst, std::abs(fast - expected));
        }
      }
      EXPECT_GT(largest, 0);
      EXPECT_LE(worst, 1e-4 * largest) << name << ", basis " << basis;
    }
  }
}

}  // namespace
}  // namespace regrade
