// The plain ray's adjoint against derivatives in double, and the fast paths against the plain
// ray.
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_weights.h"
#include "kernels/field/render.h"
#include "kernels/field/render_ray.h"
#include "tests/support/derivative.h"
#include "tests/support/double_field.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

using testing::DerivativeBy;
using testing::DoubleField;
using testing::ExactGradient;
using testing::kKink;
using testing::Largest;
using testing::RandomField;
using testing::RandomRays;
using testing::ToDouble;

class FieldGradient : public ::testing::TestWithParam<int> {};

// Relative error 1e-8 of each derivative against Richardson-extrapolated central differences.
// Kinks (ReLU of density, clamp of colour) are avoided by drawing values away from them and
// skipping parameters whose two step sizes disagree; early stopping is on (H63).
TEST_P(FieldGradient, AdjointEqualsDerivativeInDouble) {
  RadianceField field = RandomField({5, 6, 4}, GetParam(), 0.8, 21);
  DoubleField d(field);
  const MarchOptions options{0.5f, 1e-3f};
  const Vec3d d_color{0.8, -0.5, 0.3};
  int checked = 0;
  for (const Ray& ray_f : RandomRays(12, 22)) {
    const RayT<double> ray = ToDouble(ray_f);
    const RayResult<double> result = RenderRay(d.view(), ray, options);
    std::vector<double> d_density(d.density.size()), d_sh(d.sh.size());
    RenderRayAdjoint(d.view(), ray, options, result, d_color, d_density.data(), d_sh.data(),
                     PlainAdd());
    const auto loss = [&] { return Dot(RenderRay(d.view(), ray, options).color, d_color); };
    const auto check = [&](double* x, double gradient) {
      const double numeric = DerivativeBy(x, loss, 2e-4, kKink);
      if (std::isnan(numeric)) return;  // no derivative to compare
      EXPECT_NEAR(numeric, gradient,
                  testing::RecordDigits("gradient of a pixel", testing::Computed::kDouble,
                                        numeric - gradient, 1e-8, 1 + std::abs(gradient)));
      checked += gradient != 0;
    };
    for (size_t i = 0; i < d.density.size(); ++i)
      if (d_density[i] != 0 || i % 17 == 0) check(&d.density[i], d_density[i]);
    for (size_t i = 0; i < d.sh.size(); i += 5) check(&d.sh[i], d_sh[i]);
  }
  EXPECT_GT(checked, 300);
}

INSTANTIATE_TEST_SUITE_P(Basis, FieldGradient, ::testing::Values(1, 4, 9));

class FastRaysParity : public ::testing::TestWithParam<std::tuple<const char*, int>> {
 protected:
  const FastRayFunctions* functions() const { return FastRaysFor(std::get<0>(GetParam())); }
  int basis() const { return std::get<1>(GetParam()); }
};

// H70: 2e-5 per pixel; H84: skipping empty space does not change the picture.
TEST_P(FastRaysParity, RendersAsThePlainRay) {
  if (functions() == nullptr)
    GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
  for (const double fill : {0.03, 0.9}) {
    const RadianceField field = RandomField({20, 17, 23}, basis(), fill, 31);
    const FastGrid grid = MakeFastGrid(field);
    const std::vector<Ray> rays = RandomRays(500, 32);
    const MarchOptions options{0.5f, 1e-4f};
    std::vector<float> color(1500), depth(500), transmittance(500);
    functions()->render(grid, rays.data(), 500, options, color.data(), depth.data(),
                        transmittance.data());
    for (size_t r = 0; r < rays.size(); ++r) {
      const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(
            color[3 * r + c], plain.color[c],
            testing::RecordBound("a pixel against the plain ray", testing::Computed::kFloat,
                                 color[3 * r + c] - plain.color[c], 2e-5));
      ASSERT_NEAR(transmittance[r], plain.transmittance, 2e-5);
      ASSERT_NEAR(
          depth[r], plain.depth,
          testing::RecordBound("a depth against the plain ray", testing::Computed::kFloat,
                               depth[r] - plain.depth, 1e-4));
    }
  }
}

// Float gradients against the plain adjoint in double: 1e-4 of the largest entry.
TEST_P(FastRaysParity, GradientsAsThePlainAdjointInDouble) {
  if (functions() == nullptr)
    GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
  const RadianceField field = RandomField({9, 8, 10}, basis(), 0.7, 41);
  const DoubleField d(field);
  FastGrid grid = MakeFastGrid(field);
  const std::vector<Ray> rays = RandomRays(200, 42);
  const std::vector<Vec3f> targets(rays.size(), Vec3f{0.4f, 0.5f, 0.2f});
  const MarchOptions options{0.5f, 1e-4f};
  GradientArena arena;
  arena.Reset(grid.num_voxels());
  const float scale = 1.0f / 600;
  const FitStepResult step = functions()->accumulate(
      grid, {rays.data(), targets.data(), static_cast<int64_t>(rays.size())}, options, scale,
      &arena);
  const ExactGradient exact(d, rays, targets, options, double{scale});
  EXPECT_NEAR(
      step.squared_error, exact.error,
      testing::RecordDigits("loss against the plain ray in double", testing::Computed::kFloat,
                            step.squared_error - exact.error, 1e-4, exact.error));
  const double largest_density = Largest(exact.density), largest_sh = Largest(exact.sh);
  const int stride = 3 * basis();
  for (int64_t voxel = 0; voxel < grid.num_voxels(); ++voxel) {
    const int32_t slot = arena.slot_of_voxel[voxel];
    const float* g = slot < 0 ? nullptr : arena.gradient.data() + slot * grid.lanes();
    const double by_density = g ? g[DensityLane(basis())] : 0;
    ASSERT_NEAR(by_density, exact.density[voxel],
                testing::RecordDigits(
                    "gradient by densities, of its largest", testing::Computed::kFloat,
                    by_density - exact.density[voxel], 1e-4, largest_density));
    for (int k = 0; k < stride; ++k) {
      const double by_color = g ? g[k] : 0;
      ASSERT_NEAR(by_color, exact.sh[voxel * stride + k],
                  testing::RecordDigits(
                      "gradient by colours, of its largest", testing::Computed::kFloat,
                      by_color - exact.sh[voxel * stride + k], 1e-4, largest_sh));
    }
  }
}

// H103: an untouched voxel keeps its value and state bit for bit. H104: a non-finite gradient
// is counted and does not change the voxel.
TEST_P(FastRaysParity, H103_H104_StepIsSparseAndRefusesNan) {
  if (functions() == nullptr)
    GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
  FastGrid grid = MakeFastGrid(RandomField({4, 4, 4}, basis(), 1.0, 51));
  const FastGrid before = grid;
  const int lanes = grid.lanes();
  std::vector<GradientArena> arenas(2);
  for (auto& arena : arenas) arena.Reset(grid.num_voxels());
  const auto touch = [&](int arena, int32_t voxel, float value) {
    GradientArena& a = arenas[static_cast<size_t>(arena)];
    const int64_t slot = a.voxel_of_slot.size();
    a.slot_of_voxel[voxel] = static_cast<int32_t>(slot);
    a.voxel_of_slot.Resize(slot + 1);
    a.voxel_of_slot[slot] = voxel;
    a.gradient.Resize((slot + 1) * lanes);
    for (int l = 0; l <= DensityLane(basis()); ++l) a.gradient[slot * lanes + l] = value;
  };
  touch(0, 5, 0.25f);
  touch(1, 5, 0.5f);
  touch(1, 9, std::nanf(""));
  touch(1, 11, 1e-25f);  // its square underflows; epsilon keeps the step finite (H100)
  Buffer<float> moments(grid.records.size());
  int64_t rejected = 0;
  for (int s = 0; s < 2; ++s)
    rejected += functions()->step(&grid, moments.data(), arenas.data(), 2, s, 0,
                                  arenas[static_cast<size_t>(s)].voxel_of_slot.size(),
                                  {.beta = 0.95f,
                                   .epsilon = 1e-8f,
                                   .rate_sh = 0.1f,
                                   .rate_density = 2.0f,
                                   .view_bound = 10.0f});
  EXPECT_EQ(rejected, 1);
  for (int64_t v = 0; v < grid.num_voxels(); ++v)
    for (int l = 0; l <= DensityLane(basis()); ++l) {
      const float old_value = before.records[v * lanes + l],
                  value = grid.records[v * lanes + l];
      if (v == 5) {  // first touch: v = g^2, so the step is the rate for any gradient
        const float rate = l == DensityLane(basis()) ? 2.0f : 0.1f;
        EXPECT_NEAR(value, old_value - rate,
                    testing::RecordBound("a first step of RMSProp", testing::Computed::kFloat,
                                         value - (old_value - rate), 1e-5));
        EXPECT_NEAR(moments[v * lanes + l], 0.5625f, 1e-6f);
      } else if (v == 11) {
        EXPECT_TRUE(std::isfinite(value));
      } else {
        EXPECT_EQ(value, old_value);
        EXPECT_EQ(moments[v * lanes + l], 0.0f);
      }
    }
  EXPECT_EQ(grid.probes[grid.vertex_of_voxel[5]].density,
            grid.records[5 * lanes + DensityLane(basis())]);

  // The next step: voxels not touched again keep their bits, the others move.
  for (auto& arena : arenas) arena.Forget();
  const FastGrid second = grid;
  touch(1, 5, 0.5f);
  functions()->step(&grid, moments.data(), arenas.data(), 2, 1, 0, 1,
                    {.rate_sh = 0.1f, .rate_density = 2.0f, .view_bound = 10.0f});
  for (int64_t i = 0; i < grid.records.size(); ++i) {
    const int64_t lane = i % lanes;
    if (i / lanes == 5 && lane <= DensityLane(basis()))
      EXPECT_LT(grid.records[i], second.records[i]);
    else
      EXPECT_EQ(grid.records[i], second.records[i]);
  }
}

// The mean colour stays in [0, 1] and view dependence within its bound, for any step size.
TEST_P(FastRaysParity, StepIsProjected) {
  if (functions() == nullptr)
    GTEST_SKIP() << "this processor lacks " << std::get<0>(GetParam());
  for (const float direction : {-1.0f, 1.0f}) {
    FastGrid grid = MakeFastGrid(RandomField({3, 3, 3}, basis(), 1.0, 52));
    const int lanes = grid.lanes();
    GradientArena arena;
    arena.Reset(grid.num_voxels());
    arena.slot_of_voxel[4] = 0;
    arena.voxel_of_slot.Resize(1);
    arena.voxel_of_slot[0] = 4;
    arena.gradient.Resize(lanes);
    for (int l = 0; l <= DensityLane(basis()); ++l) arena.gradient[l] = direction;
    Buffer<float> moments(grid.records.size());
    functions()->step(&grid, moments.data(), &arena, 1, 0, 0, 1,
                      {.rate_sh = 100, .rate_density = 100, .view_bound = 0.3f});
    for (int l = 0; l < 3 * basis(); ++l) {
      const float value = grid.records[4 * lanes + l];
      if (l % basis() == 0) {
        EXPECT_NEAR(0.5 + kSh0 * value, direction > 0 ? 0 : 1, 1e-6);
      } else {
        EXPECT_EQ(value, -direction * 0.3f);
      }
    }
    EXPECT_GT(std::abs(grid.records[4 * lanes + DensityLane(basis())]),
              80);  // densities are not bounded
    functions()->step(&grid, moments.data(), &arena, 1, 0, 0, 1,
                      {.rate_sh = 100, .mean_bound = kUnbounded, .view_bound = kUnbounded});
    for (int l = 0; l < 3 * basis(); ++l)  // as published
      EXPECT_GT(std::abs(grid.records[4 * lanes + l]), 50);
  }
}

INSTANTIATE_TEST_SUITE_P(AllPaths, FastRaysParity,
                         ::testing::Combine(::testing::Values("baseline", "avx2", "avx512"),
                                            ::testing::Values(1, 4, 9)),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param)) + "_basis" +
                                  std::to_string(std::get<1>(info.param));
                         });

// The weights are the renderer's: colours blended from the lists equal the rendered ones.
TEST(RayWeights, GiveTheRenderedColour) {
  const RadianceField field = RandomField({12, 13, 11}, 9, 0.7, 71);
  const std::vector<Ray> rays = RandomRays(600, 72);
  const MarchOptions options{0.5f, 1e-4f};
  const RayWeights weights = ComputeRayWeights(
      *field.geometry, {rays.data(), static_cast<int64_t>(rays.size())}, options, 0.0f);
  ASSERT_EQ(weights.num_rays(), 600);
  for (size_t r = 0; r < rays.size(); ++r) {
    const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
    float gamma[9];
    ShBasis(9, rays[r].direction, gamma);
    Vec3f color{};
    float sum = 0;
    for (int64_t s = weights.first[r]; s < weights.first[r + 1]; ++s) {
      const WeightedSample& sample = weights.samples[static_cast<size_t>(s)];
      Vec3f raw;
      color += SampleColor(ViewOf(field), {sample.vertex, sample.fraction}, gamma, &raw) *
               sample.weight;
      sum += sample.weight;
    }
    color += field.background * weights.transmittance[r];
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(color[c], plain.color[c],
                  testing::RecordBound("colours blended by weights", testing::Computed::kFloat,
                                       color[c] - plain.color[c], 1e-6));
    ASSERT_NEAR(sum + weights.transmittance[r], 1, 1e-5);
  }
}

// H67: a pixel does not depend on the partition of the picture into tiles.
TEST(RenderView, H67_TilesAndThePlainBodyAgree) {
  const RadianceField field = RandomField({16, 16, 16}, 9, 0.5, 81);
  Camera camera = testing::PinholeOf(37, 29, 40);
  camera.camera_from_world.translation = {0, 0, 3};
  const RenderedView fast = RenderView(field, camera, {0.5f, 1e-4f});
  const RenderedView plain = RenderViewPlain(field, camera, {0.5f, 1e-4f});
  for (size_t i = 0; i < fast.color.pixels.size(); ++i)
    ASSERT_NEAR(
        fast.color.pixels[i], plain.color.pixels[i],
        testing::RecordBound("a frame against the plain body", testing::Computed::kFloat,
                             fast.color.pixels[i] - plain.color.pixels[i], 2e-5));
  for (size_t i = 0; i < fast.depth.pixels.size(); ++i)
    ASSERT_NEAR(fast.depth.pixels[i], plain.depth.pixels[i], 1e-4);
  const testing::Threads threads(omp_get_max_threads() == 1 ? 3 : 1);
  const RenderedView other = RenderView(field, camera, {0.5f, 1e-4f});
  EXPECT_TRUE(testing::RecordSameBits("1 and more threads", testing::Computed::kFloat,
                                      other.color.pixels == fast.color.pixels));
  EXPECT_EQ(other.depth.pixels, fast.depth.pixels);
}

}  // namespace
}  // namespace regrade
