// Parts of the fast path that differ from the specification: vectorised opacities, skipping,
// and the largest weights of voxels.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/field/cpu/rays.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_weights.h"
#include "kernels/field/render_ray.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::RandomField;
using testing::RandomRays;

// H52: vectorised opacities are as accurate as expm1 and exp: two units of the last place, from
// the smallest optical depth to the largest.
TEST(FastRays, OpacityAndDecayAreAccurate) {
  std::vector<float> tau = {0.0f, 1e-38f, 86.99f, 87.0f, 104.0f};
  for (double t = 1e-35; t < 104; t *= 1.0007) tau.push_back(static_cast<float>(t));
  for (float t = 0.001f; t < 90; t += 0.0037f) tau.push_back(t);
  const int64_t n = static_cast<int64_t>(tau.size());
  std::vector<float> alpha(tau.size()), decay(tau.size());
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    functions->opacity(tau.data(), n, alpha.data(), decay.data());
    for (size_t i = 0; i < tau.size(); ++i) {
      const double exact_alpha = -std::expm1(-static_cast<double>(tau[i]));
      const double exact_decay = std::exp(-static_cast<double>(tau[i]));
      ASSERT_NEAR(alpha[i], exact_alpha,
                  testing::RecordDigits("opacity", testing::Computed::kFloat,
                                        alpha[i] - exact_alpha, 2.4e-7, exact_alpha))
          << name << " at " << tau[i];
      // Below 1.7e-38, near the smallest normal number, it is 0.
      ASSERT_NEAR(decay[i], exact_decay, 2.4e-7 * exact_decay + 1.7e-38)
          << name << " at " << tau[i];
    }
  }
}

// Skipping ends at the first step that may be occupied: fields with isolated voxels, with rays
// that skip in every direction, including axis-parallel ones.
TEST(FastRays, H84_SkippingLosesNoVoxel) {
  const RadianceField field = RandomField({37, 41, 33}, 1, 0.0005, 33);
  const FastGrid grid = MakeFastGrid(field);
  std::vector<Ray> rays = RandomRays(4000, 34);
  for (int i = 0; i < 2000; ++i) {
    Vec3f origin = rays[static_cast<size_t>(i)].origin * 0.4f, direction{};
    origin[i % 3] = i % 2 ? -2.0f : 2.0f;
    direction[i % 3] = i % 2 ? 1.0f : -1.0f;
    rays.push_back({origin, direction});
  }
  const MarchOptions options{0.5f, 1e-4f};
  std::vector<float> color(3 * rays.size()), depth(rays.size()), transmittance(rays.size());
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    functions->render(grid, rays.data(), static_cast<int64_t>(rays.size()), options,
                      color.data(), depth.data(), transmittance.data());
    int seen = 0;
    for (size_t r = 0; r < rays.size(); ++r) {
      const RayResult<float> plain = RenderRay(ViewOf(field), rays[r], options);
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(color[3 * r + c], plain.color[c],
                    testing::RecordBound("a pixel past empty space", testing::Computed::kFloat,
                                         color[3 * r + c] - plain.color[c], 2e-5))
            << name;
      seen += plain.transmittance < 0.99f;
    }
    EXPECT_GT(seen, 100);
  }
}

// A voxel's weight is the largest one of the samples that it is a corner of.
TEST(FastRays, LargestWeightsAreThoseOfTheSamples) {
  const RadianceField field = RandomField({9, 8, 10}, 4, 0.6, 35);
  const FastGrid grid = MakeFastGrid(field);
  const std::vector<Ray> rays = RandomRays(400, 36);
  const int64_t n = static_cast<int64_t>(rays.size());
  const MarchOptions options{0.5f, 1e-4f};
  std::vector<float> expected(static_cast<size_t>(grid.num_voxels()));
  const RayWeights weights =
      ComputeRayWeights(*field.geometry, {rays.data(), n}, options, field.near_clip);
  for (const WeightedSample& sample : weights.samples) {
    int32_t points[8];
    CornerPoints(*field.geometry, sample, points);
    for (const int32_t point : points)
      if (point >= 0)
        expected[static_cast<size_t>(point)] =
            std::max(expected[static_cast<size_t>(point)], sample.weight);
  }
  for (const char* name : {"baseline", "avx2", "avx512"}) {
    const FastRayFunctions* functions = FastRaysFor(name);
    if (functions == nullptr) continue;
    std::vector<float> most(expected.size());
    functions->max_weights(grid, rays.data(), n, options, most.data());
    for (size_t v = 0; v < most.size(); ++v) ASSERT_NEAR(most[v], expected[v], 2e-5) << name;
  }
}

}  // namespace
}  // namespace regrade
