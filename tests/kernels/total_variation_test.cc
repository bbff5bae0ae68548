// Total variation: value and gradient of one function, and the fast path (H97, H98).
#include "kernels/field/total_variation.h"

#include <gtest/gtest.h>

#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "tests/support/derivative.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

TEST(TotalVariation, H97_GradientIsTheValuesDerivative) {
  const RadianceField field =
      testing::RandomField({5, 6, 7}, 1, 0.7, 91);  // voxels are not cubes (H98)
  const Geometry& g = *field.geometry;
  for (const bool empty_is_zero : {false, true}) {
    std::vector<double> values(g.density.begin(), g.density.end());
    std::vector<double> gradient(values.size());
    const auto value = [&] {
      return TotalVariation<double>(g.frame, g.links.data(), values.data(), 1, 0, empty_is_zero,
                                    0, g.frame.NumVertices(), 1.0, nullptr);
    };
    TotalVariation<double>(g.frame, g.links.data(), values.data(), 1, 0, empty_is_zero, 0,
                           g.frame.NumVertices(), 1.0, gradient.data());
    for (size_t i = 0; i < values.size(); ++i) {
      const double numeric = testing::DerivativeBy(&values[i], value, 2e-4);
      EXPECT_NEAR(
          numeric, gradient[i],
          testing::RecordDigits("gradient", testing::Computed::kDouble, numeric - gradient[i],
                                1e-8, 1 + std::abs(gradient[i])));
    }
  }
}

TEST(TotalVariation, H97_ConstantAndShiftedFields) {
  RadianceField field = testing::RandomField({6, 6, 6}, 1, 1.0, 92);
  const Geometry& g = *field.geometry;
  const int64_t n = g.frame.NumVertices();
  std::vector<double> values(static_cast<size_t>(n), 3.5), gradient(values.size());
  const double flat = TotalVariation<double>(g.frame, g.links.data(), values.data(), 1, 0, true,
                                             0, n, 1.0, gradient.data());
  const double roots = static_cast<double>(n) * std::sqrt(kVariationEpsilon);
  EXPECT_NEAR(flat, roots,
              testing::RecordDigits("a constant field", testing::Computed::kDouble,
                                    flat - roots, 1e-9));
  for (const double d : gradient) EXPECT_EQ(d, 0.0);
  // A bump inside the box weighs the same at every position.
  const auto bump_at = [&](int x, int y, int z) {
    std::vector<double> bump(static_cast<size_t>(n));
    bump[static_cast<size_t>(g.links[g.frame.Vertex(x, y, z)])] = 1;
    return TotalVariation<double>(g.frame, g.links.data(), bump.data(), 1, 0, true, 0, n, 1.0,
                                  nullptr);
  };
  EXPECT_NEAR(bump_at(2, 2, 2), bump_at(3, 2, 3), 1e-12);
}

TEST(TotalVariation, FastPathEqualsThePlainOne) {
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    for (const int basis : {1, 4, 9}) {
      const FastGrid grid = MakeFastGrid(testing::RandomField({7, 5, 6}, basis, 0.6, 93));
      GradientArena arena;
      arena.Reset(grid.num_voxels());
      const int64_t begin = 13, end = 190;
      functions->total_variation(grid, begin, end, 0.7f, 0.2f, &arena);
      std::vector<float> plain(static_cast<size_t>(grid.records.size()));
      for (int lane = 0; lane <= DensityLane(basis); ++lane) {
        const bool density = lane == DensityLane(basis);
        TotalVariation<float>(grid.frame, grid.links.data(), grid.records.data(), grid.lanes(),
                              lane, density, begin, end, density ? 0.7f : 0.2f, plain.data());
      }
      for (int64_t v = 0; v < grid.num_voxels(); ++v) {
        const int32_t slot = arena.slot_of_voxel[v];
        for (int lane = 0; lane <= DensityLane(basis); ++lane) {
          const float fast = slot < 0 ? 0.0f : arena.gradient[slot * grid.lanes() + lane];
          const float exact = plain[static_cast<size_t>(v * grid.lanes() + lane)];
          ASSERT_NEAR(fast, exact,
                      testing::RecordBound("fast against plain", testing::Computed::kFloat,
                                           fast - exact, 2e-6))
              << name << " basis " << basis;
        }
      }
    }
  }
}

TEST(TotalVariation, H98_AxesAreWeightedByTheirVoxels) {
  // Twice the vertices along an axis of the same box: voxels are half as long, and the same
  // world gradient is half as large between neighbouring voxels.
  const auto slope = [](const Vec3i& resolution, int axis) {
    const RadianceField field = testing::RandomField(resolution, 1, 1.0, 94);
    const Geometry& g = *field.geometry;
    std::vector<double> values(static_cast<size_t>(g.num_voxels()));
    for (int x = 0; x < resolution.x; ++x)
      for (int y = 0; y < resolution.y; ++y)
        for (int z = 0; z < resolution.z; ++z) {
          const int at[3] = {x, y, z};
          values[static_cast<size_t>(g.links[g.frame.Vertex(x, y, z)])] =
              100.0 * at[axis] / resolution[axis];
        }
    // One vertex in the middle, with all neighbours.
    const int64_t middle = g.frame.Vertex(resolution.x / 2, resolution.y / 2, resolution.z / 2);
    return TotalVariation<double>(g.frame, g.links.data(), values.data(), 1, 0, false, middle,
                                  middle + 1, 1.0, nullptr);
  };
  for (int axis = 0; axis < 3; ++axis) {
    Vec3i fine{8, 8, 8};
    fine[axis] = 16;
    const double coarse = slope({8, 8, 8}, axis), finer = slope(fine, axis);
    EXPECT_NEAR(finer, coarse,
                testing::RecordDigits("a slope in other voxels", testing::Computed::kDouble,
                                      finer - coarse, 1e-8));
  }
}

}  // namespace
}  // namespace regrade
