#include "evaluate/image_quality.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

TEST(Psnr, KnownValuesAndUndefinedOnes) {
  const Image a = ConstantImage(20, 15, 0.5f), b = ConstantImage(20, 15, 0.6f);
  EXPECT_NEAR(*Psnr(a, b), 20, 1e-5);
  EXPECT_TRUE(std::isinf(*Psnr(a, a)));
  const Image all = ConstantImage(20, 15, 1, 1);
  EXPECT_FALSE(Psnr(a, b, &all));
  Image spoiled = b, mask(20, 15, 1);
  spoiled.at(3, 3)[0] = 50;
  *mask.at(3, 3) = 0.7f;
  *mask.at(4, 4) = 0.5f;  // not above one half: counted
  EXPECT_NEAR(*Psnr(a, spoiled, &mask), 20, 1e-5);
  spoiled.at(3, 3)[0] = kNan;
  EXPECT_NEAR(*Psnr(a, spoiled), 20, 1e-5);
}

TEST(Psnr, H123_SumsAreDouble) {
  const Image a = ConstantImage(2048, 2048, 0, 1), b = ConstantImage(2048, 2048, 0.1f, 1);
  const double exact = static_cast<double>(0.1f) * 0.1f;
  EXPECT_NEAR(*MeanSquaredError(a, b), exact,
              testing::RecordDigits("mean over many pixels", testing::Computed::kDouble,
                                    *MeanSquaredError(a, b) - exact, 1e-10, exact));
}

// One window, directly from the definition.
double LiteralSsim(const Image& a, const Image& b) {
  double norm = 0, ma = 0, mb = 0, va = 0, vb = 0, cov = 0;
  const auto weight = [](int x, int y) {
    return std::exp(-((x - 5) * (x - 5) + (y - 5) * (y - 5)) / (2 * 1.5 * 1.5));
  };
  for (int y = 0; y < 11; ++y)
    for (int x = 0; x < 11; ++x) {
      norm += weight(x, y);
      ma += weight(x, y) * *a.at(x, y);
      mb += weight(x, y) * *b.at(x, y);
    }
  ma /= norm, mb /= norm;
  for (int y = 0; y < 11; ++y)
    for (int x = 0; x < 11; ++x) {
      const double da = *a.at(x, y) - ma, db = *b.at(x, y) - mb;
      va += weight(x, y) / norm * da * da;
      vb += weight(x, y) / norm * db * db;
      cov += weight(x, y) / norm * da * db;
    }
  return (2 * ma * mb + 1e-4) * (2 * cov + 9e-4) /
         ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4));
}

TEST(Ssim, AgreesWithTheDefinition) {
  const Image a = NoiseImage(11, 11, 1, 1);
  Image b = NoiseImage(11, 11, 2, 1);
  for (size_t i = 0; i < b.pixels.size(); ++i)
    b.pixels[i] = 0.3f * b.pixels[i] + 0.7f * a.pixels[i];
  EXPECT_NEAR(*Ssim(a, b), LiteralSsim(a, b),
              testing::RecordDigits("SSIM against its definition", testing::Computed::kDouble,
                                    *Ssim(a, b) - LiteralSsim(a, b), 1e-12));
  EXPECT_NEAR(*Ssim(NoiseImage(40, 30, 5), NoiseImage(40, 30, 5)), 1, 1e-12);
  EXPECT_LT(*Ssim(NoiseImage(40, 30, 5), NoiseImage(40, 30, 6)), 0.1);
  EXPECT_FALSE(Ssim(NoiseImage(10, 30, 5), NoiseImage(10, 30, 5)));
}

TEST(GradientCorrelation, SeesStructureAndNotColour) {
  const Image a = WaveImage(60, 50, 0, 0);
  Image darker = a;
  for (float& p : darker.pixels) p = 0.5f * p + 0.1f;
  EXPECT_NEAR(*GradientCorrelation(a, darker), 1, 1e-5);
  EXPECT_LT(*GradientCorrelation(a, NoiseImage(60, 50, 3)), 0.3);
  EXPECT_FALSE(GradientCorrelation(a, ConstantImage(60, 50, 0.5f)));
}

}  // namespace
}  // namespace regrade
