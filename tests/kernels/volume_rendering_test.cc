// Compositing along a ray: identities and extremes (hard cases H51 to H67).
#include "kernels/field/volume_rendering.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "kernels/base/random.h"
#include "tests/support/derivative.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

constexpr double kFloatEpsilon = 1.19e-7;

TEST(VolumeRendering, H51_WeightsAndTransmittanceSumToOne) {
  for (uint64_t ray = 0; ray < 200; ++ray) {
    CompositeState<float> state;
    float sum = 0;
    const int n = 1 + static_cast<int>(RandomIndex(1, ray, 0, 300));
    for (int i = 0; i < n; ++i) {
      const float tau = static_cast<float>(
          std::pow(10.0, -8 + 9 * RandomDouble(1, ray, static_cast<uint64_t>(i) + 1)));
      sum += Composite(tau, Vec3f{1, 1, 1}, &state);
    }
    // Each step adds at most a rounding of the weight and one of the transmittance.
    EXPECT_NEAR(sum + state.transmittance, 1.0,
                testing::RecordDigits(
                    "weights and transmittance, of 1, over samples", testing::Computed::kFloat,
                    sum + state.transmittance - 1.0, 4 * kFloatEpsilon, n + 1));
  }
}

TEST(VolumeRendering, H52_TinyOpticalDepthKeepsItsLastBit) {
  EXPECT_EQ(Opacity(0.0f), 0.0f);
  for (const float tau : {1e-30f, 1e-10f, 1e-8f, 1e-40f})  // 1e-40 is subnormal
    EXPECT_EQ(Opacity(tau), tau);
  const long double ratio = Opacity(1e-6f) / -std::expm1(-static_cast<long double>(1e-6f));
  EXPECT_NEAR(static_cast<double>(ratio), 1.0,
              testing::RecordDigits("opacity of a thin sample", testing::Computed::kFloat,
                                    static_cast<double>(ratio - 1), kFloatEpsilon));
  // 1 - exp(-tau) would give 0 at 1e-8.
  EXPECT_EQ(1.0f - std::exp(-1e-8f), 0.0f);
}

TEST(VolumeRendering, H53_HugeDensityIsOpaqueAndFinite) {
  for (const float density : {1e9f, 1e30f, std::numeric_limits<float>::infinity()}) {
    const float tau = OpticalDepth(density, 0.01f);
    CompositeState<float> state;
    const Vec3f color{0.2f, 0.7f, 0.4f};
    EXPECT_EQ(Composite(tau, color, &state), 1.0f);
    EXPECT_EQ(state.color, color);
    EXPECT_LT(state.transmittance, 1e-30f);
    Vec3f behind{1, 1, 1};
    EXPECT_TRUE(std::isfinite(
        CompositeAdjoint(0.01f, tau, state.transmittance, color, {1, 1, 1}, &behind)));
    EXPECT_EQ(behind, color);
  }
}

TEST(VolumeRendering, H54_InfiniteDensityOverNoLengthIsEmpty) {
  EXPECT_EQ(OpticalDepth(std::numeric_limits<float>::infinity(), 0.0f), 0.0f);
}

TEST(VolumeRendering, H55_H56_NegativeAndNanDensityAreEmpty) {
  const testing::MayBeNotFinite allowed;
  EXPECT_EQ(OpticalDepth(-3.0f, 0.1f), 0.0f);
  EXPECT_EQ(OpticalDepth(std::nanf(""), 0.1f), 0.0f);
}

TEST(VolumeRendering, H57_LongRayUnderflowsQuietly) {
  CompositeState<float> state;
  for (int i = 0; i < 100000; ++i) Composite(0.01f, Vec3f{0.5f, 0.5f, 0.5f}, &state);
  EXPECT_GE(state.transmittance, 0.0f);
  EXPECT_LT(state.transmittance, 1e-37f);
  EXPECT_NEAR(state.color.x, 0.5f,
              testing::RecordDigits("colour of 100 000 samples", testing::Computed::kFloat,
                                    state.color.x - 0.5, 1e-4));
}

// The adjoint against central differences with one Richardson step, in double (relative error
// about 1e-10).
TEST(VolumeRendering, H58_H61_AdjointEqualsDerivative) {
  constexpr int kN = 12;
  for (uint64_t scene = 0; scene < 20; ++scene) {
    std::vector<double> sigma(kN), delta(kN);
    std::vector<Vec3d> color(kN);
    for (int i = 0; i < kN; ++i) {
      const auto u = [&](int k) {
        return RandomDouble(scene, 5, static_cast<uint64_t>(8 * i + k));
      };
      sigma[i] = i == 6 && scene == 3 ? 400.0 : 8 * u(0);  // one nearly opaque sample
      delta[i] = 0.05 + 0.1 * u(1);
      color[i] = {u(2), u(3), u(4)};
    }
    Vec3d background{0.3, 0.9, 0.1};
    const Vec3d d_color{0.7, -1.1, 0.4};
    const auto loss = [&] {
      CompositeState<double> state;
      for (int i = 0; i < kN; ++i)
        Composite(OpticalDepth(sigma[i], delta[i]), color[i], &state);
      return Dot(state.color + background * state.transmittance, d_color);
    };
    const auto derivative = [&](double* x) { return testing::DerivativeBy(x, loss, 1e-3); };
    std::vector<double> weight(kN), after(kN);
    CompositeState<double> state;
    for (int i = 0; i < kN; ++i) {
      weight[i] = Composite(OpticalDepth(sigma[i], delta[i]), color[i], &state);
      after[i] = state.transmittance;
    }
    Vec3d behind = background;
    for (int i = kN - 1; i >= 0; --i) {
      const double d_sigma = CompositeAdjoint(delta[i], OpticalDepth(sigma[i], delta[i]),
                                              after[i], color[i], d_color, &behind);
      const double by_sigma = derivative(&sigma[i]), by_color = derivative(&color[i].x);
      EXPECT_NEAR(d_sigma, by_sigma,
                  testing::RecordDigits("gradient by densities", testing::Computed::kDouble,
                                        d_sigma - by_sigma, 1e-8, 1 + std::abs(d_sigma)));
      EXPECT_NEAR(weight[i] * d_color.x, by_color,
                  testing::RecordDigits("gradient by colours", testing::Computed::kDouble,
                                        weight[i] * d_color.x - by_color, 1e-9));
    }
    const double by_background = derivative(&background.y);
    EXPECT_NEAR(state.transmittance * d_color.y, by_background,
                testing::RecordDigits("gradient by the background", testing::Computed::kDouble,
                                      state.transmittance * d_color.y - by_background, 1e-9));
  }
}

// Strongly occluded samples have the right sign of their gradient in float.
TEST(VolumeRendering, H59_SuffixFormKeepsSignsInFloat) {
  int wrong = 0, counted = 0;
  for (uint64_t ray = 0; ray < 400; ++ray) {
    constexpr int kN = 64;
    std::vector<float> tau(kN), after(kN);
    std::vector<double> after_d(kN);
    std::vector<Vec3f> color(kN);
    CompositeState<float> state;
    CompositeState<double> state_d;
    for (int i = 0; i < kN; ++i) {
      const auto u = [&](int k) {
        return RandomDouble(ray, 9, static_cast<uint64_t>(8 * i + k));
      };
      tau[i] = static_cast<float>(u(0) < 0.5 ? 0.002 * u(1) : 1.5 * u(1));
      color[i] = {static_cast<float>(u(2)), static_cast<float>(u(3)), static_cast<float>(u(4))};
      Composite(tau[i], color[i], &state);
      Composite<double>(tau[i], color[i].Cast<double>(), &state_d);
      after[i] = state.transmittance;
      after_d[i] = state_d.transmittance;
    }
    Vec3f behind{0.5f, 0.5f, 0.5f};
    Vec3d behind_d{0.5, 0.5, 0.5};
    for (int i = kN - 1; i >= 0; --i) {
      const float g =
          CompositeAdjoint(1.0f, tau[i], after[i], color[i], {1, -0.5f, 0.3f}, &behind);
      const double g_d = CompositeAdjoint<double>(
          1.0, tau[i], after_d[i], color[i].Cast<double>(), {1.0, -0.5, 0.3}, &behind_d);
      if (after_d[i] < 1e-7 || std::abs(g_d) < 1e-12) continue;
      ++counted;
      wrong += (g > 0) != (g_d > 0);
    }
  }
  EXPECT_GT(counted, 1000);
  EXPECT_LE(wrong,
            counted * testing::RecordBound("fraction of wrong signs", testing::Computed::kFloat,
                                           static_cast<double>(wrong) / counted, 1e-4));
}

}  // namespace
}  // namespace regrade
