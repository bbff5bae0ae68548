// The plain ray in extreme cases: early stops, walls, clamped colours, many steps (hard cases
// H53, H62, H65, H66).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "kernels/field/render_ray.h"
#include "tests/support/double_field.h"
#include "tests/support/record_error.h"
#include "tests/support/small_field.h"

namespace regrade {
namespace {

using testing::DoubleField;
using testing::RandomField;
using testing::RandomRays;
using testing::ToDouble;

// H62: stopping early costs at most the bound in each channel.
TEST(RayLoss, H62_EarlyStopIsWithinItsBound) {
  RadianceField field = RandomField({16, 16, 16}, 4, 0.9, 61);
  field.background = {1, 1, 1};
  for (const float stop : {1e-1f, 1e-2f, 1e-3f})
    for (const Ray& ray : RandomRays(300, 62)) {
      const Vec3f exact = RenderRay(ViewOf(field), ray, {0.5f, 0.0f}).color;
      const Vec3f stopped = RenderRay(ViewOf(field), ray, {0.5f, stop}).color;
      // Colours here stay below 4.
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(exact[c], stopped[c],
                    stop * testing::RecordBound("error of an early stop over its threshold",
                                                testing::Computed::kFloat,
                                                (exact[c] - stopped[c]) / stop, 4));
    }
}

// Light beyond an early stop counts as background: a scene of one colour keeps it. (Dropping
// the light would stay within the bound, but darken the picture.)
TEST(RayLoss, H62_LightBeyondAStopIsTheBackground) {
  RadianceField field = RandomField({16, 16, 16}, 4, 0.9, 63);
  std::fill(field.appearance.sh.begin(), field.appearance.sh.end(), 0.0f);  // mid-grey
  field.background = {0.5f, 0.5f, 0.5f};
  for (const Ray& ray : RandomRays(300, 64))
    // About fifty samples, each with a rounding of its weight and one of the transmittance.
    ASSERT_NEAR(
        RenderRay(ViewOf(field), ray, {0.5f, 0.1f}).color.x, 0.5,
        testing::RecordBound("a scene of one colour", testing::Computed::kFloat,
                             RenderRay(ViewOf(field), ray, {0.5f, 0.1f}).color.x - 0.5, 1e-5));
}

// A row of vertices along x, one world unit apart: the box is [0, n) x [0, 2) x [0, 2).
RadianceField RowOfVertices(int n, const std::function<float(int)>& density_at) {
  auto geometry = std::make_shared<Geometry>();
  const float half = 0.5f * static_cast<float>(n);
  geometry->frame = {{n, 2, 2}, {half, 1, 1}, {half, 1, 1}};
  geometry->links.Resize(4 * n);
  geometry->density.Resize(4 * n);
  RadianceField field;
  field.appearance.basis = 1;
  field.appearance.sh.Resize(12 * n);
  for (int v = 0; v < 4 * n; ++v) {
    geometry->links[v] = v;
    geometry->density[v] = density_at(v / 4);
    for (int c = 0; c < 3; ++c)
      field.appearance.sh[3 * v + c] = 0.5f + 0.1f * static_cast<float>((v + c) % 5);
  }
  field.geometry = std::move(geometry);
  return field;
}

// Tests the clamp's gradient on both sides: a channel just below 0 has none.
TEST(RayLoss, H65_AClampedChannelTakesNoGradient) {
  RadianceField field = RandomField({6, 6, 6}, 1, 1.0, 65);
  for (const double side : {-1e-3, 1e-3}) {
    for (int64_t i = 0; i < field.appearance.sh.size(); i += 3)
      field.appearance.sh[i] = static_cast<float>((-0.5 + side) / kSh0);
    int touched = 0;
    for (const Ray& ray : RandomRays(20, 66)) {
      const RayResult<float> result = RenderRay(ViewOf(field), ray, {0.5f, 1e-4f});
      std::vector<float> d_density(field.geometry->density.size()),
          d_sh(field.appearance.sh.size());
      RenderRayAdjoint(ViewOf(field), ray, {0.5f, 1e-4f}, result, {1, 1, 1}, d_density.data(),
                       d_sh.data(), PlainAdd());
      for (size_t i = 0; i < d_sh.size(); i += 3) {
        EXPECT_EQ(d_sh[i] != 0, side > 0 && d_sh[i + 1] != 0);
        touched += d_sh[i + 1] != 0;
      }
    }
    EXPECT_GT(touched, 100);
  }
}

// An opaque wall's optical depth, 1e8 and more, would absorb the digits of the mist before it
// in the running sum from which the adjoint recovers weights: depths end at 104, where exp is
// 0.
TEST(RayLoss, H53_MistBeforeAWallKeepsItsGradient) {
  const RadianceField field = RowOfVertices(40, [](int x) {
    return x < 5 ? 0.0f : x < 20 ? 0.05f : 1e9f;
  });
  const DoubleField d(field);
  const MarchOptions options{0.5f, 1e-4f};
  const Ray ray{{0.3f, 0.8f, 1.1f}, {1, 0, 0}};
  std::vector<float> d_density(d.density.size()), d_sh(d.sh.size());
  std::vector<double> exact_density(d.density.size()), exact_sh(d.sh.size());
  const RayResult<float> result = RenderRay(ViewOf(field), ray, options);
  RenderRayAdjoint(ViewOf(field), ray, options, result, {1, 1, 1}, d_density.data(),
                   d_sh.data(), PlainAdd());
  const RayResult<double> exact = RenderRay(d.view(), ToDouble(ray), options);
  RenderRayAdjoint(d.view(), ToDouble(ray), options, exact, {1, 1, 1}, exact_density.data(),
                   exact_sh.data(), PlainAdd());
  EXPECT_NEAR(result.color.x, exact.color.x, 1e-5);
  for (int v = 0; v < 4 * 19; ++v) {
    // Float rounding of a sum of 104 is 4e-6 of each weight; 1e-4 leaves a margin for its
    // parts.
    EXPECT_NEAR(
        d_density[v], exact_density[v],
        testing::RecordBound("gradient of mist before a wall", testing::Computed::kFloat,
                             d_density[v] - exact_density[v], 1e-4))
        << v;
    EXPECT_NEAR(d_sh[3 * v], exact_sh[3 * v], 1e-4) << v;
  }
}

// t_i = t_0 + i step: the last of two thousand steps of 0.1 is off by at most 3e-5, so the
// first sample in a wall has the right index. Accumulating steps would drift by 0.003.
TEST(RayLoss, H66_TwoThousandStepsDoNotDrift) {
  const RadianceField field = RowOfVertices(202, [](int x) { return x < 200 ? 0.0f : 1e9f; });
  for (int phase = 0; phase < 50; ++phase) {  // never within 1e-3 of the wall
    const float x = 0.201f + 0.002f * static_cast<float>(phase);
    const RayResult<float> result =
        RenderRay(ViewOf(field), Ray{{x, 1, 1}, {1, 0, 0}}, {0.1f, 1e-4f});
    // The wall's density rises from vertex 199, at 199.5 in the world.
    const double first = std::floor((199.5 - x) / static_cast<double>(0.1f)) + 1;
    EXPECT_EQ(static_cast<double>(result.last_step), first) << phase;
  }
}

}  // namespace
}  // namespace regrade
