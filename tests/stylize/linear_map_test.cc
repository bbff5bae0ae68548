#include "stylize/linear_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

double Uniform(uint64_t seed, uint64_t i) { return 2 * RandomDouble(seed, 17, i) - 1; }

ColorMap RandomMap(uint64_t seed) {
  ColorMap map;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) map.matrix(i, j) = Uniform(seed, 3 * i + j);
    map.offset[i] = Uniform(seed, 9 + i);
  }
  return map;
}

Vec3d RandomColor(uint64_t seed, uint64_t i) {
  return {RandomDouble(seed, 1, i), RandomDouble(seed, 2, i), RandomDouble(seed, 3, i)};
}

// EQ(sh-basis) without the clamp.
template <typename T>
Vec3<T> Color(int basis, const T* sh, const Vec3<T>& direction) {
  T gamma[kMaxBasis];
  ShBasis(basis, direction, gamma);
  Vec3<T> color{T(0.5), T(0.5), T(0.5)};
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < basis; ++k) color[c] += sh[c * basis + k] * gamma[k];
  return color;
}

template <typename T>
double LargestErrorOfLemma2() {
  double worst = 0;
  for (const int basis : {1, 4, 9}) {
    for (uint64_t seed = 0; seed < 300; ++seed) {
      const ColorMap map = RandomMap(seed);
      T sh[3 * kMaxBasis], mapped[3 * kMaxBasis];
      for (int i = 0; i < 3 * basis; ++i) sh[i] = static_cast<T>(Uniform(seed, 100 + i));
      MapCoefficients(map, basis, sh, mapped);
      const Vec3<T> direction =
          Normalized(Vec3d{Uniform(seed, 50), Uniform(seed, 51), Uniform(seed, 52)})
              .template Cast<T>();
      const Vec3d expected = map(Color(basis, sh, direction).template Cast<double>());
      worst = std::max(
          worst, Norm(Color(basis, mapped, direction).template Cast<double>() - expected));
    }
  }
  return worst;
}

TEST(LinearMap, Lemma2_MappedCoefficientsGiveMappedColours) {
  EXPECT_LE(LargestErrorOfLemma2<double>(),
            testing::RecordDigits("mapped colours", testing::Computed::kDouble,
                                  LargestErrorOfLemma2<double>(), 1e-12));
  // Up to 30 products of size 1 to 5 in float, each rounded to 6e-8.
  EXPECT_LE(LargestErrorOfLemma2<float>(),
            testing::RecordDigits("mapped colours in float", testing::Computed::kFloat,
                                  LargestErrorOfLemma2<float>(), 4e-6));
}

// The remark on Lemma 2: A s with b added to the constant coefficients is the colour
// A c + b Gamma_0 + v - A v, where v = 1/2.
TEST(LinearMap, Lemma2_RemarkOnAnOffsetOfCoefficients) {
  double worst = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    const ColorMap map = RandomMap(seed);
    ColorMap colors = map;
    const Vec3d v{0.5, 0.5, 0.5}, b = map.offset;
    colors.offset = b * kSh0 + v - map.matrix * v;
    double sh[27], mapped[27], expected[27];
    for (uint64_t i = 0; i < 27; ++i) sh[i] = Uniform(seed, 100 + i);
    MapCoefficients(colors, 9, sh, expected);
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 9; ++k) {
        mapped[c * 9 + k] = k == 0 ? b[c] : 0;
        for (int d = 0; d < 3; ++d) mapped[c * 9 + k] += map.matrix(c, d) * sh[d * 9 + k];
      }
    for (int i = 0; i < 27; ++i) worst = std::max(worst, std::abs(mapped[i] - expected[i]));
  }
  EXPECT_LE(worst, testing::RecordDigits("coefficients with an offset",
                                         testing::Computed::kDouble, worst, 1e-12));
}

TEST(LinearMap, AppearanceIsMappedVoxelByVoxel) {
  const ColorMap map = RandomMap(5);
  Appearance appearance;
  appearance.basis = 4;
  appearance.sh.Resize(12 * 1000);
  for (int64_t i = 0; i < appearance.sh.size(); ++i)
    appearance.sh[i] = static_cast<float>(Uniform(6, i));
  const Appearance result = ApplyColorMap(appearance, map);
  ASSERT_EQ(result.sh.size(), appearance.sh.size());
  ASSERT_EQ(result.basis, 4);
  for (int64_t v = 0; v < 1000; ++v) {
    float expected[12];
    MapCoefficients(map, 4, &appearance.sh[12 * v], expected);
    for (int i = 0; i < 12; ++i) ASSERT_EQ(result.sh[12 * v + i], expected[i]);
  }
  // The identity leaves every bit.
  const Appearance same = ApplyColorMap(appearance, ColorMap{});
  for (int64_t i = 0; i < same.sh.size(); ++i) ASSERT_EQ(same.sh[i], appearance.sh[i]);
}

TEST(LinearMap, SpectralNorm) {
  EXPECT_NEAR(SpectralNorm({{{3, 0, 0}, {0, -5, 0}, {0, 0, 1}}}), 5, 1e-14);
  EXPECT_NEAR(SpectralNorm({{{0, 1000, 0}, {0, 0, 0}, {0, 0, 0}}}), 1000, 1e-12);
  EXPECT_EQ(SpectralNorm({{{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}), 0);
  Mat3d bad;
  bad(1, 2) = std::nan("");
  EXPECT_THROW(SpectralNorm(bad), CheckFailure);
}

TEST(LeastSquares, RecoversAMap) {
  const ColorMap truth = RandomMap(8);
  LeastSquaresAccumulator first, second;
  for (int i = 0; i < 5000; ++i) {
    const Vec3d source = RandomColor(1, i);
    (i % 3 == 0 ? first : second).Add(source, truth(source), 0.1 + RandomDouble(2, 0, i));
  }
  first += second;
  const ColorMap map = first.Solve();
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(map.offset[i], truth.offset[i], 1e-11);
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(map.matrix(i, j), truth.matrix(i, j),
                  testing::RecordDigits("a map by least squares", testing::Computed::kDouble,
                                        map.matrix(i, j) - truth.matrix(i, j), 1e-11));
  }
}

TEST(LeastSquares, WeightAndOpacityMeanWhatTheySay) {
  const ColorMap truth = RandomMap(9);
  LeastSquaresAccumulator sums;
  for (int i = 0; i < 2000; ++i) {
    const Vec3d source = RandomColor(3, i);
    const double opacity = RandomDouble(4, 0, i);
    sums.Add(source, truth.matrix * source + truth.offset * opacity, 1, opacity);
    sums.Add(source, {9, 9, 9}, 0);  // weight 0: never seen
  }
  const ColorMap map = sums.Solve();
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(map.offset[i], truth.offset[i], 1e-11);
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(map.matrix(i, j), truth.matrix(i, j), 1e-11);
  }
}

TEST(LeastSquares, ResidualIsOrthogonalToTheSources) {
  // Targets that no linear map gives: the normal equations are what is left to hold.
  LeastSquaresAccumulator sums;
  const auto target = [](const Vec3d& s) { return Vec3d{s.x * s.y, s.z * s.z, std::sin(s.x)}; };
  for (int i = 0; i < 1000; ++i) sums.Add(RandomColor(5, i), target(RandomColor(5, i)));
  const ColorMap map = sums.Solve();
  double moment[3][4] = {};
  for (int i = 0; i < 1000; ++i) {
    const Vec3d s = RandomColor(5, i), residual = map(s) - target(s);
    const double x[4] = {s.x, s.y, s.z, 1};
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 4; ++k) moment[c][k] += residual[c] * x[k];
  }
  for (const auto& row : moment)
    for (const double value : row) EXPECT_NEAR(value, 0, 1e-9);
}

TEST(LeastSquares, GreySourcesGiveABoundedMap) {
  LeastSquaresAccumulator sums;
  for (int i = 0; i < 3000; ++i) {
    const double g = RandomDouble(6, 0, i) + 0.1 * std::sin(i);  // rounding in all products
    sums.Add({g, g, g}, {0.5 * g + 0.1, 0.4, 1 - g});
  }
  const ColorMap map = sums.Solve();
  EXPECT_LE(SpectralNorm(map.matrix), 2);
  const Vec3d mapped = map({0.3, 0.3, 0.3});
  EXPECT_NEAR(mapped.x, 0.25, 1e-10);
  EXPECT_NEAR(mapped.y, 0.4, 1e-10);
  EXPECT_NEAR(mapped.z, 0.7, 1e-10);
  // Nothing at all: the zero map.
  EXPECT_EQ(SpectralNorm(LeastSquaresAccumulator().Solve().matrix), 0);
}

}  // namespace
}  // namespace regrade
