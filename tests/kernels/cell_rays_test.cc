// Gradients of adaptive fields in double, and the CPU's fast path against the plain ray.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cell_variation.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_weights.h"
#include "kernels/field/render_ray.h"
#include "tests/support/cell_field.h"
#include "tests/support/derivative.h"
#include "tests/support/double_field.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using testing::DerivativeBy;
using testing::DoubleField;
using testing::kKink;
using testing::RandomCellField;
using testing::RandomRays;
using testing::ToDouble;

// Rays cross faces between levels, so the gradients of the vertices on them are among those
// checked.
TEST(CellGradient, H166_AdjointEqualsDerivativeInDoubleAcrossFaces) {
  for (const int basis : {1, 9}) {
    const RadianceField field = RandomCellField({2, 2, 2}, 2, basis, 21);
    DoubleField d(field);
    const MarchOptions options{0.5f, 1e-3f};
    const Vec3d d_color{0.8, -0.5, 0.3};
    int checked = 0;
    for (const Ray& ray_f : RandomRays(20, 22)) {
      const RayT<double> ray = ToDouble(ray_f);
      const RayResult<double> result = RenderRay(d.view(), ray, options);
      std::vector<double> d_density(d.density.size()), d_sh(d.sh.size());
      RenderRayAdjoint(d.view(), ray, options, result, d_color, d_density.data(), d_sh.data(),
                       PlainAdd());
      const auto loss = [&] { return Dot(RenderRay(d.view(), ray, options).color, d_color); };
      const auto check = [&](double* x, double gradient) {
        const double numeric = DerivativeBy(x, loss, 2e-4, kKink);
        if (std::isnan(numeric)) return;
        EXPECT_NEAR(numeric, gradient,
                    testing::RecordDigits("gradient of a pixel", testing::Computed::kDouble,
                                          numeric - gradient, 1e-8, 1 + std::abs(gradient)));
        checked += gradient != 0;
      };
      for (size_t i = 0; i < d.density.size(); ++i)
        if (d_density[i] != 0 || i % 37 == 0) check(&d.density[i], d_density[i]);
      for (size_t i = 0; i < d.sh.size(); ++i)
        if (d_sh[i] != 0 && i % 7 == 0) check(&d.sh[i], d_sh[i]);
    }
    EXPECT_GT(checked, 200);
  }
}

TEST(CellVariation, H166_GradientIsTheValuesDerivative) {
  const RadianceField field = RandomCellField({2, 2, 2}, 2, 1, 23);
  const CellsView cells = ViewOf(field.geometry->cells, field.geometry->frame.resolution);
  const int64_t n = field.geometry->cells.num_cells();
  std::vector<double> values(field.geometry->density.begin(), field.geometry->density.end());
  std::vector<double> gradient(values.size());
  const double unit[] = {0.5, 0.25, 0.125};
  const auto value = [&] {
    return CellVariation<double>(cells, values.data(), 1, 0, unit, 0, n, 1.0, nullptr);
  };
  CellVariation<double>(cells, values.data(), 1, 0, unit, 0, n, 1.0, gradient.data());
  for (size_t i = 0; i < values.size(); i += 3)
    EXPECT_NEAR(DerivativeBy(&values[i], value, 2e-4), gradient[i],
                1e-8 * (1 + std::abs(gradient[i])));
  // A constant field has none, on any levels.
  std::fill(values.begin(), values.end(), 3.5);
  EXPECT_NEAR(value(), static_cast<double>(n) * std::sqrt(1e-9), 1e-9);
}

TEST(CellRays, FastPathsEqualThePlainRay) {
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    for (const int basis : {1, 4, 9}) {
      const RadianceField field = RandomCellField({3, 2, 2}, 3, basis, 31);
      const FastGrid grid = MakeFastGrid(field);
      const std::vector<Ray> rays = RandomRays(400, 32);
      const MarchOptions options{0.5f, 1e-4f};
      std::vector<float> color(1200), depth(400), transmittance(400);
      functions->render(grid, rays.data(), 400, options, color.data(), depth.data(),
                        transmittance.data());
      std::vector<float> plain_weights(static_cast<size_t>(grid.cells().num_cells()));
      const RayWeights weights =
          ComputeRayWeights(*field.geometry, {rays.data(), 400}, options, field.near_clip);
      for (const WeightedSample& s : weights.samples)
        plain_weights[static_cast<size_t>(s.vertex)] =
            std::max(plain_weights[static_cast<size_t>(s.vertex)], s.weight);
      for (size_t r = 0; r < rays.size(); ++r) {
        const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(
              color[3 * r + c], plain.color[c],
              testing::RecordBound("a pixel against the plain ray", testing::Computed::kFloat,
                                   color[3 * r + c] - plain.color[c], 2e-5));
        ASSERT_NEAR(transmittance[r], plain.transmittance, 2e-5);
        ASSERT_NEAR(depth[r], plain.depth, 1e-4);
        ASSERT_NEAR(weights.transmittance[r], plain.transmittance, 1e-6);
      }
      std::vector<float> most(plain_weights.size());
      functions->max_weights(grid, rays.data(), 400, options, most.data());
      for (size_t c = 0; c < most.size(); ++c) ASSERT_NEAR(most[c], plain_weights[c], 2e-5);
    }
  }
}

// Rays share vectors, so what is beside a ray must not change a bit of it: the order and the
// number of rays in a batch differ between threads, tiles and shards.
TEST(CellRays, ARayIsTheSameAloneAndAmongOthers) {
  const RadianceField field = RandomCellField({3, 2, 2}, 3, 9, 31);
  const FastGrid grid = MakeFastGrid(field);
  std::vector<Ray> rays = RandomRays(200, 33);
  rays[7].direction = {};  // has no samples
  rays[50].origin.x = NAN;
  const MarchOptions options{0.5f, 1e-4f};
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    std::vector<float> color(600), depth(200), transmittance(200);
    functions->render(grid, rays.data(), 200, options, color.data(), depth.data(),
                      transmittance.data());
    for (size_t r = 0; r < rays.size(); ++r) {
      float alone[3], its_depth, its_transmittance;
      functions->render(grid, &rays[r], 1, options, alone, &its_depth, &its_transmittance);
      for (int c = 0; c < 3; ++c) ASSERT_EQ(alone[c], color[3 * r + c]) << name << " " << r;
      ASSERT_EQ(its_depth, depth[r]);
      ASSERT_EQ(its_transmittance, transmittance[r]);
    }
  }
}

// Float gradients against the plain adjoint in double: 1e-4 of the largest entry.
TEST(CellRays, FastGradientsEqualThePlainAdjoint) {
  for (const int basis : {1, 4, 9}) {
    const RadianceField field = RandomCellField({2, 2, 2}, 2, basis, 41);
    const DoubleField d(field);
    const FastGrid grid = MakeFastGrid(field);
    const std::vector<Ray> rays = RandomRays(200, 42);
    const std::vector<Vec3f> targets(rays.size(), Vec3f{0.4f, 0.5f, 0.2f});
    const MarchOptions options{0.5f, 1e-4f};
    const float scale = 1.0f / 600;
    GradientArena arena;
    arena.Reset(grid.num_voxels());
    FastRays().accumulate(grid, {rays.data(), targets.data(), 200}, options, scale, &arena);
    FastRays().total_variation(grid, 5, 40, 0.7f, 0.2f, &arena);
    std::vector<double> d_density(d.density.size()), d_sh(d.sh.size());
    for (size_t r = 0; r < rays.size(); ++r) {
      const RayT<double> ray{rays[r].origin.Cast<double>(), rays[r].direction.Cast<double>()};
      const RayResult<double> result = RenderRay(d.view(), ray, options);
      const Vec3d d_color = (result.color - targets[r].Cast<double>()) * (2.0 * scale);
      RenderRayAdjoint(d.view(), ray, options, result, d_color, d_density.data(), d_sh.data(),
                       PlainAdd());
    }
    const CellsView cells = ViewOf(grid.cells(), grid.frame.resolution);
    std::vector<double> unit, one(static_cast<size_t>(grid.cells().finest) + 1, 1.0);
    for (int level = 0; level <= grid.cells().finest; ++level)
      unit.push_back(WorldWidth(grid.frame, 1 << (grid.cells().finest - level)));
    CellVariation<double>(cells, d.density.data(), 1, 0, unit.data(), 5, 40, 0.7,
                          d_density.data());
    const int stride = 3 * basis;
    for (int i = 0; i < stride; ++i)
      CellVariation<double>(cells, d.sh.data(), stride, i, one.data(), 5, 40, 0.2, d_sh.data());
    double largest = 0, worst = 0;
    for (const double g : d_density) largest = std::max(largest, std::abs(g));
    for (const double g : d_sh) largest = std::max(largest, std::abs(g));
    for (int64_t v = 0; v < grid.num_voxels(); ++v) {
      const int32_t slot = arena.slot_of_voxel[v];
      const auto at = [&](int lane) {
        return slot < 0 ? 0.0 : double{arena.gradient[int64_t{slot} * grid.lanes() + lane]};
      };
      worst =
          std::max(worst, std::abs(at(DensityLane(basis)) - d_density[static_cast<size_t>(v)]));
      for (int i = 0; i < stride; ++i)
        worst = std::max(worst, std::abs(at(i) - d_sh[static_cast<size_t>(v * stride + i)]));
    }
    EXPECT_GT(largest, 0);
    EXPECT_LE(worst, 1e-4 * largest);
  }
}

TEST(CellRays, AStepScalesTheRateOfEachDensity) {
  FastGrid grid = MakeFastGrid(RandomCellField({2, 2, 2}, 1, 4, 51));
  const FastGrid before = grid;
  grid.density_rate = Buffer<float>(grid.num_voxels());
  for (int64_t v = 0; v < grid.num_voxels(); ++v)
    grid.density_rate[v] = v % 2 == 0 ? 1.0f : 0.25f;
  GradientArena arena;
  arena.Reset(grid.num_voxels());
  FastRays().total_variation(grid, 0, grid.cells().num_cells(), 1.0f, 1.0f, &arena);
  Buffer<float> moment(grid.records.size());
  RmspropOptions options;
  options.rate_density = 1;
  options.view_bound = 10;
  FastRays().step(&grid, moment.data(), &arena, 1, 0, 0, arena.voxel_of_slot.size(), options);
  for (int64_t v = 0; v < grid.num_voxels(); ++v) {
    const int64_t at = v * grid.lanes() + DensityLane(4);
    // The first step of RMSprop is the rate, whatever the gradient.
    EXPECT_NEAR(std::abs(grid.records[at] - before.records[at]), grid.density_rate[v], 1e-3);
    EXPECT_EQ(grid.vertex_density[v], grid.records[at]);
  }
}

}  // namespace
}  // namespace regrade
