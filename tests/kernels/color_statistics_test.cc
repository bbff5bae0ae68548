#include "kernels/image/color_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "tests/support/expect_error.h"
#include "tests/support/floating_point_traps.h"
#include "tests/support/record_error.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

constexpr double kEps = std::numeric_limits<double>::epsilon();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Image RandomImage(int width, int height, uint64_t seed, bool is_8_bit) {
  Image image(width, height);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = is_8_bit ? static_cast<float>(RandomIndex(seed, 0, i, 256)) / 255.0f
                               : static_cast<float>(1.4 * RandomDouble(seed, 0, i) - 0.2);
  return image;
}

Image Pixels(const std::vector<Vec3f>& colors) {
  Image image(static_cast<int>(colors.size()), 1);
  for (size_t i = 0; i < colors.size(); ++i)
    for (int c = 0; c < 3; ++c) image.pixels[3 * i + c] = colors[i][c];
  return image;
}

bool SameBits(const ColorStatistics& a, const ColorStatistics& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

// Mean and covariance in long double, two passes, pixel by pixel.
void ExpectMatchesReference(const Image& image, const ColorStatistics& s, double tolerance) {
  const int64_t n = image.num_pixels();
  long double mean[3] = {}, covariance[3][3] = {};
  for (int64_t i = 0; i < n; ++i)
    for (int c = 0; c < 3; ++c)
      mean[c] += image.pixels[3 * i + c] / static_cast<long double>(n);
  for (int64_t i = 0; i < n; ++i)
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b < 3; ++b)
        covariance[a][b] += (image.pixels[3 * i + a] - mean[a]) *
                            (image.pixels[3 * i + b] - mean[b]) / static_cast<long double>(n);
  EXPECT_EQ(s.count, n);
  for (int a = 0; a < 3; ++a) {
    EXPECT_NEAR(s.mean[a], static_cast<double>(mean[a]), tolerance * (1 + std::abs(s.mean[a])));
    for (int b = 0; b < 3; ++b)
      EXPECT_NEAR(s.covariance(a, b), static_cast<double>(covariance[a][b]),
                  testing::RecordBound(
                      "covariance against long double", testing::Computed::kDouble,
                      s.covariance(a, b) - static_cast<double>(covariance[a][b]), tolerance));
  }
}

TEST(ColorStatistics, MatchesALongDoubleReference) {
  // 8-bit values are snapped to v / 255, which float represents to 3e-8.
  const Image bytes = RandomImage(61, 47, 1, true);
  ExpectMatchesReference(bytes, MeasureColor(bytes), 1e-7);
  const Image floats = RandomImage(61, 47, 2, false);
  ExpectMatchesReference(floats, MeasureColor(floats), 1e-14);
}

TEST(ColorStatistics, H11_FewPixels) {
  const Vec3f red{1, 0, 0}, green{0, 1, 0}, blue{0, 0, 1};
  const auto rank = [](const std::vector<Vec3f>& colors) {
    const EigenSystem eigen = CovarianceEigen(MeasureColor(Pixels(colors)).covariance);
    return (eigen.values.x > 0) + (eigen.values.y > 0) + (eigen.values.z > 0);
  };
  const ColorStatistics one = MeasureColor(Pixels({{0.2f, 0.5f, 0.123f}}));
  EXPECT_EQ(one.count, 1);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(one.covariance.row[i], Vec3d{});
  EXPECT_EQ(rank({red}), 0);
  EXPECT_EQ(rank({red, green}), 1);
  EXPECT_EQ(rank({red, green, blue}), 2);
  EXPECT_EQ(rank({red, green, blue, {0, 0, 0}}), 3);
  EXPECT_EQ(rank({red, red, red, red}), 0);
}

TEST(ColorStatistics, H12_NothingSelectedIsAnError) {
  const Image image = RandomImage(5, 4, 3, true);
  const Image nothing(5, 4, 1);
  Image spoiled(2, 2);
  for (float& v : spoiled.pixels) v = std::numeric_limits<float>::quiet_NaN();
  for (const auto& measure : {std::function<void()>([&] { MeasureColor(image, &nothing); }),
                              std::function<void()>([&] { MeasureColor(spoiled); }),
                              std::function<void()>([&] { Pool({}); }),
                              std::function<void()>([&] { Pool({ColorStatistics{}}); })}) {
    EXPECT_REGRADE_ERROR(measure(), ExitCode::kInput, "mask selects no pixel");
  }
}

TEST(ColorStatistics, F17_AMaskOfAnotherSizeIsRefused) {
  Image small(4, 4, 1);
  for (float& v : small.pixels) v = 1;
  EXPECT_REGRADE_ERROR(MeasureColor(RandomImage(5, 4, 3, true), &small), ExitCode::kInput,
                       "the mask is 4x4, its picture 5x4");
}

TEST(ColorStatistics, MaskAlphaAndNanLeavePixelsOut) {
  Image image(4, 1, 4);
  const float rgba[4][4] = {
      {0.2f, 0.4f, 0.6f, 1}, {1, 1, 1, 0}, {static_cast<float>(kNan), 0, 0, 1}, {0, 1, 0, 1}};
  std::memcpy(image.pixels.data(), rgba, sizeof rgba);
  Image mask(4, 1, 1);
  mask.pixels = {1, 1, 1, 0};
  const ColorStatistics s = MeasureColor(image, &mask);
  EXPECT_EQ(s.count, 1);
  EXPECT_NEAR(s.mean.z, 0.6, 1e-7);
}

TEST(ColorStatistics, H17_AHundredMillionConstantPixelsHaveNoVariance) {
  // 100 pictures of a million pixels, of which one is stored: Pool gives the sums of 1e8
  // pixels.
  Image image(1000, 1000);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = 0.1f * (1 + i % 3);
  const ColorStatistics floats = MeasureColor(image);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = (i % 3 + 77) / 255.0f;
  const ColorStatistics bytes = MeasureColor(image);
  const ColorStatistics pooled = Pool(std::vector<ColorStatistics>(100, bytes));
  EXPECT_EQ(pooled.count, 100000000);
  EXPECT_EQ(pooled.mean, bytes.mean);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(pooled.covariance.row[i], Vec3d{});
  // Float: the mean of 1e6 equal values is off by at most the rounding of their sum.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_LE(std::abs(floats.covariance(i, j)),
                testing::RecordBound("variance of a constant", testing::Computed::kDouble,
                                     floats.covariance(i, j), 1e-20));
}

TEST(ColorStatistics, H17_IntegerSumsDoNotLoseASingleStep) {
  // One pixel of a million differs by one step: its variance is (n - 1) / n^2 / 255^2.
  Image image(1000, 1000);
  for (float& v : image.pixels) v = 254 / 255.0f;
  image.pixels[0] = 1;
  const double n = 1e6, truth = (n - 1) / (n * n * 255 * 255);
  const double measured = MeasureColor(image).covariance(0, 0);
  EXPECT_NEAR(
      measured, truth,
      testing::RecordDigits("variance of one step in a million", testing::Computed::kDouble,
                            measured - truth, 4 * kEps, truth));
}

TEST(ColorStatistics, H17_SameBitsForAnyNumberOfThreads) {
  for (const bool is_8_bit : {true, false}) {
    const Image image = RandomImage(127, 203, 5, is_8_bit);
    const testing::Threads single(1);
    const ColorStatistics one = MeasureColor(image);
    for (const int n : {2, 3, 7}) {
      const testing::Threads threads(n);
      EXPECT_TRUE(testing::RecordSameBits("1 to 7 threads", testing::Computed::kDouble,
                                          SameBits(MeasureColor(image), one)))
          << n << " threads, 8-bit " << is_8_bit;
    }
  }
}

TEST(ColorStatistics, H18_SmallSpreadAroundALargeMean) {
  // One pass, E[x^2] - E[x]^2, is off by 1e4^2 * 1e-16 = 1e-8 even in double, for a variance of
  // 9e-5, and useless in float. Two passes are off by roundings of squares near 1e-4.
  Image image(400, 300);
  for (int64_t i = 0; i < image.num_pixels(); ++i) {
    const float step = static_cast<float>(RandomIndex(9, 0, static_cast<uint64_t>(i), 33)) - 16;
    for (int c = 0; c < 3; ++c) image.pixels[3 * i + c] = 1e4f + 0x1p-10f * step;  // exact
  }
  ExpectMatchesReference(image, MeasureColor(image), 1e-13);
}

TEST(ColorStatistics, PoolIsTheStatisticsOfAllPixels) {
  for (const bool is_8_bit : {true, false}) {
    const Image whole = RandomImage(40, 30, 7, is_8_bit);
    std::vector<ColorStatistics> parts;
    for (int first = 0; first < 30; first += 6 + first / 6) {
      const int rows = std::min(6 + first / 6, 30 - first);
      Image part(40, rows);
      std::copy_n(whole.at(0, first), part.pixels.size(), part.pixels.begin());
      parts.push_back(MeasureColor(part));
    }
    parts.push_back({});  // a view without pixels is ignored
    const ColorStatistics pooled = Pool(parts), all = MeasureColor(whole);
    EXPECT_EQ(pooled.count, all.count);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(pooled.mean[i], all.mean[i], 1e-15);
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(pooled.covariance(i, j), all.covariance(i, j), 1e-15);
    }
  }
}

TEST(SymmetricEigen, DecomposesAndReadsBothTriangles) {
  const Mat3d m{{{2, 1, 0.5}, {0, 3, -1}, {-0.5, 1, 4}}};  // (m + m^T) / 2 is another matrix
  const EigenSystem eigen = SymmetricEigen(m);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      double value = 0;
      for (int k = 0; k < 3; ++k)
        value += eigen.vectors(i, k) * eigen.values[k] * eigen.vectors(j, k);
      EXPECT_NEAR(value, 0.5 * (m(i, j) + m(j, i)), 1e-14);
    }
}

TEST(SymmetricEigen, H14_TinyNegativeEigenvaluesAreZeroOthersAreBugs) {
  const auto with = [](double smallest) {
    return Mat3d{{{smallest, 0, 0}, {0, 0.01, 0}, {0, 0, 0.1}}};
  };
  EXPECT_EQ(CovarianceEigen(with(-60 * kEps * 0.1)).values.x, 0);
  EXPECT_EQ(CovarianceEigen(with(60 * kEps * 0.1)).values.x, 0);
  EXPECT_GT(CovarianceEigen(with(70 * kEps * 0.1)).values.x, 0);
  EXPECT_THROW(CovarianceEigen(with(-70 * kEps * 0.1)), CheckFailure);
  EXPECT_THROW(CovarianceEigen(with(-1)), CheckFailure);
  EXPECT_EQ(CovarianceEigen(kZeroMat3d).values, Vec3d{});
}

TEST(SymmetricEigen, H15_NanAndInfinityAreRefused) {
  const testing::MayBeNotFinite allowed;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (const double bad : {kNan, HUGE_VAL, -HUGE_VAL}) {
        Mat3d m{{{1, 0.1, 0.2}, {0.1, 2, 0.3}, {0.2, 0.3, 3}}};
        m(i, j) = bad;
        EXPECT_THROW(SymmetricEigen(m), CheckFailure) << i << j << bad;
      }
}

TEST(SymmetricEigen, H16_ResidualOfTheIterativeSolver) {
  // The closed form loses eight digits for two nearly equal eigenvalues beside another.
  double worst = 0;
  for (uint64_t seed = 0; seed < 20000; ++seed) {
    Vec3d axes[3];
    for (int i = 0; i < 3; ++i) axes[0][i] = RandomDouble(seed, 1, i) - 0.5;
    axes[0] = Normalized(axes[0]);
    axes[1] = Normalized(Cross(axes[0], Vec3d{1, 2, 3}));
    axes[2] = Cross(axes[0], axes[1]);
    const double gap = std::pow(10.0, -14 * RandomDouble(seed, 2, 0));
    const double values[3] = {RandomDouble(seed, 3, 0), 1, 1 + gap};
    Mat3d m = kZeroMat3d;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < 3; ++i) m.row[i] += axes[k] * (values[k] * axes[k][i]);
    const EigenSystem eigen = SymmetricEigen(m);
    for (int k = 0; k < 3; ++k) {
      const Vec3d v{eigen.vectors(0, k), eigen.vectors(1, k), eigen.vectors(2, k)};
      worst = std::max(worst, Norm(m * v - v * eigen.values[k]));
    }
  }
  EXPECT_LE(worst, testing::RecordDigits("residual of eigenvectors", testing::Computed::kDouble,
                                         worst, 1e-14));
}

}  // namespace
}  // namespace regrade
