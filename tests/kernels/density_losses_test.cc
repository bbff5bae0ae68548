// Losses of densities: values at their ends, gradients in double, and the fast paths against
// the plain adjoint.
#include "kernels/field/density_losses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/render_ray.h"
#include "tests/support/derivative.h"
#include "tests/support/double_field.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::DerivativeBy;
using testing::DoubleField;
using testing::RandomField;
using testing::RandomRays;
using testing::ToDouble;

// Both losses of a ray, from the samples that the plain ray composites.
double LossesOf(const FieldView<double>& field, const RayT<double>& ray,
                const MarchOptions& options, const DensityLosses& losses) {
  const RayResult<double> result = RenderRay(field, ray, options);
  double sum = double{losses.beta} * BetaLoss(std::exp(-result.optical_depth));
  const GridRay<double> march = ClipToGrid(field.frame, ray, 0.0, double{options.step});
  for (int64_t i = 0; i <= result.last_step; ++i) {
    double density;
    const double t = march.t_begin + static_cast<double>(i) * double{options.step};
    Interpolate(field.frame, field.links, field.density, 1, 1,
                LocateCell(field.frame, march.At(t)), &density);
    if (density > 0) sum += double{losses.sparsity} * SparsityLoss(density);
  }
  return sum;
}

const DensityLosses kLosses{1e-3f, 1e-2f};

// The beta loss is lowest on clear rays and on opaque ones; in between, at T = (1 + 1e-3) / 2,
// its slope has the other sign.
TEST(DensityLosses, BetaPushesToBothEnds) {
  EXPECT_NEAR(BetaLoss(1.0), std::log(1e-3), 1e-12);
  EXPECT_NEAR(BetaLossSlope(1.0), 999, 1e-9);  // more density would cost: it is removed
  EXPECT_EQ(BetaLossSlope(0.0), -1);           // behind what is opaque it is added
  EXPECT_NEAR(BetaLossSlope(0.5005), 0, 1e-12);
  EXPECT_EQ(SparsityLoss(0.0), 0);
  EXPECT_EQ(DensityLossSlope(DensityLosses(), 0.3, 2.0, 0.1), 0);
}

// Relative error 1e-8, as FieldGradient.AdjointEqualsDerivativeInDouble.
TEST(DensityLosses, AdjointEqualsDerivativeInDouble) {
  const RadianceField field = RandomField({5, 6, 4}, 1, 0.8, 21);
  DoubleField d(field);
  const MarchOptions options{0.5f, 1e-3f};
  int checked = 0;
  for (const Ray& ray_f : RandomRays(12, 22)) {
    const RayT<double> ray = ToDouble(ray_f);
    const RayResult<double> result = RenderRay(d.view(), ray, options);
    std::vector<double> d_density(d.density.size()), d_sh(d.sh.size());
    RenderRayAdjoint<double>(d.view(), ray, options, result, {}, d_density.data(), d_sh.data(),
                             PlainAdd(), nullptr, nullptr, kLosses);
    const auto loss = [&] { return LossesOf(d.view(), ray, options, kLosses); };
    for (size_t i = 0; i < d.density.size(); ++i) {
      const double numeric = DerivativeBy(&d.density[i], loss, 2e-4, testing::kKink);
      if (std::isnan(numeric)) continue;  // no derivative to compare
      EXPECT_NEAR(numeric, d_density[i], 1e-8 * (1 + std::abs(d_density[i])));
      checked += d_density[i] != 0;
    }
    EXPECT_EQ(std::ranges::count(d_sh, 0.0), std::ssize(d_sh));
  }
  EXPECT_GT(checked, 100);
}

// Float gradients against the plain adjoint in double: 1e-4 of the largest entry.
TEST(DensityLosses, FastPathsEqualThePlainAdjoint) {
  const RadianceField field = RandomField({9, 8, 10}, 4, 0.7, 41);
  const DoubleField d(field);
  const FastGrid grid = MakeFastGrid(field);
  const std::vector<Ray> rays = RandomRays(200, 42);
  const std::vector<Vec3f> targets(rays.size(), Vec3f{0.4f, 0.5f, 0.2f});
  const MarchOptions options{0.5f, 1e-4f};
  const float scale = 1.0f / 600;
  const testing::ExactGradient without(d, rays, targets, options, double{scale}),
      exact(d, rays, targets, options, double{scale}, kLosses);
  const double largest = testing::Largest(exact.density);
  double change = 0;
  for (size_t v = 0; v < exact.density.size(); ++v)
    change = std::max(change, std::abs(exact.density[v] - without.density[v]));
  EXPECT_GT(change, 0.1 * largest);  // the losses count here
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    GradientArena arena;
    arena.Reset(grid.num_voxels());
    functions->accumulate(grid, {rays.data(), targets.data(), 200, kLosses}, options, scale,
                          &arena);
    for (int64_t v = 0; v < grid.num_voxels(); ++v) {
      const int32_t slot = arena.slot_of_voxel[v];
      const double fast =
          slot < 0 ? 0 : arena.gradient[int64_t{slot} * grid.lanes() + DensityLane(grid.basis)];
      ASSERT_NEAR(fast, exact.density[static_cast<size_t>(v)], 1e-4 * largest) << name;
    }
  }
}

}  // namespace
}  // namespace regrade
