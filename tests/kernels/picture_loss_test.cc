#include "kernels/image/picture_loss.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "evaluate/image_quality.h"
#include "kernels/base/random.h"
#include "tests/support/threads.h"

namespace regrade {
namespace {

constexpr int kWidth = 37, kHeight = 29;  // no multiple of a band, nor of a vector

struct Pair {
  std::vector<double> photo, picture;

  Pair() : photo(3 * kWidth * kHeight), picture(photo.size()) {
    for (size_t i = 0; i < photo.size(); ++i) {
      const double wave = 0.5 + 0.3 * std::sin(0.11 * static_cast<double>(i));
      photo[i] = std::round((wave + 0.1 * RandomDouble(1, 2, i)) * 65535) / 65535;
      picture[i] = wave + 0.2 * (RandomDouble(1, 3, i) - 0.5);
    }
  }
  void Mask(int x, int y) {
    photo[static_cast<size_t>(3 * (y * kWidth + x) + 1)] =
        std::numeric_limits<double>::quiet_NaN();
  }
  double Loss(double lambda, std::vector<double>* d) const {
    d->resize(photo.size());
    const PictureSums sums =
        ComparePlain(kWidth, kHeight, photo.data(), picture.data(), lambda, d->data());
    const double n = static_cast<double>(photo.size());
    return (1 - lambda) * sums.absolute / n + lambda * (1 - sums.similarity / n);
  }
};

// Central differences in double; the absolute value has a kink, which no pixel here is near.
TEST(PictureLoss, GradientIsThatOfTheLoss) {
  Pair pair;
  pair.Mask(20, 11);
  for (const double lambda : {0.0, 0.2, 1.0}) {
    std::vector<double> d, other;
    pair.Loss(lambda, &d);
    double scale = 0;
    for (const double value : d) scale = std::max(scale, std::abs(value));
    for (size_t i = 0; i < d.size(); i += 61) {
      constexpr double kStep = 1e-6;
      const double kept = pair.picture[i];
      pair.picture[i] = kept + kStep;
      const double above = pair.Loss(lambda, &other);
      pair.picture[i] = kept - kStep;
      const double below = pair.Loss(lambda, &other);
      pair.picture[i] = kept;
      EXPECT_NEAR(d[i], (above - below) / (2 * kStep), 1e-6 * scale) << i << ' ' << lambda;
    }
  }
}

// Away from the border, S is the evaluator's.
TEST(PictureLoss, SimilarityIsTheEvaluatorsInside) {
  const Pair pair;
  Image a(kWidth, kHeight), b(kWidth, kHeight);
  for (size_t i = 0; i < pair.photo.size(); ++i) {
    a.pixels[i] = static_cast<float>(pair.photo[i]);
    b.pixels[i] = static_cast<float>(pair.picture[i]);
  }
  const std::vector<double> taps = SsimTaps<double>();
  double sum = 0;
  int64_t count = 0;
  for (int y = kSsimReach; y < kHeight - kSsimReach; ++y)
    for (int x = kSsimReach; x < kWidth - kSsimReach; ++x)
      for (int c = 0; c < 3; ++c) {
        double p = 0, q = 0, r = 0, m = 0, square = 0;
        for (int v = 0; v <= 2 * kSsimReach; ++v)
          for (int u = 0; u <= 2 * kSsimReach; ++u) {
            const double w = taps[static_cast<size_t>(u)] * taps[static_cast<size_t>(v)];
            const double seen = b.at(x + u - kSsimReach, y + v - kSsimReach)[c];
            const double own = a.at(x + u - kSsimReach, y + v - kSsimReach)[c];
            p += w * seen, q += w * seen * seen, r += w * seen * own;
            m += w * own, square += w * own * own;
          }
        sum += SsimOf(p, q, r, m, square).s;
        ++count;
      }
  EXPECT_NEAR(sum / static_cast<double>(count), *Ssim(b, a), 1e-6);
}

void ExpectFastIsPlain(const Pair& pair) {
  std::vector<double> expected(pair.photo.size());
  const PictureSums plain = ComparePlain(kWidth, kHeight, pair.photo.data(),
                                         pair.picture.data(), 0.2, expected.data());
  std::vector<uint16_t> photo(pair.photo.size());
  std::vector<uint8_t> masked(photo.size() / 3);
  for (size_t i = 0; i < photo.size(); ++i) {
    if (std::isfinite(pair.photo[i]))
      photo[i] = static_cast<uint16_t>(std::lround(pair.photo[i] * 65535));
    else
      masked[i / 3] = 1;
  }
  const std::vector<float> picture(pair.picture.begin(), pair.picture.end());
  std::vector<float> one(picture.size()), d(picture.size());
  LossRows rows;
  {
    const testing::Threads threads(1);
    Compare(kWidth, kHeight, photo.data(), masked.data(), picture.data(), 0.2f, &rows,
            one.data());
  }
  const testing::Threads threads(3);
  const PictureSums sums = Compare(kWidth, kHeight, photo.data(), masked.data(), picture.data(),
                                   0.2f, &rows, d.data());
  EXPECT_EQ(one, d);
  EXPECT_EQ(sums.values, plain.values);
  EXPECT_NEAR(sums.absolute, plain.absolute, 1e-5 * plain.absolute);
  EXPECT_NEAR(sums.squared, plain.squared, 1e-5 * plain.squared);
  EXPECT_NEAR(sums.similarity, plain.similarity, 1e-4 * plain.similarity);
  double square = 0, error = 0;
  for (size_t i = 0; i < d.size(); ++i) {
    square += expected[i] * expected[i];
    error += (d[i] - expected[i]) * (d[i] - expected[i]);
  }
  EXPECT_LT(std::sqrt(error / square), 2e-4);  // float variances, of 9e-4 and more
}

TEST(PictureLoss, FastIsPlain) {
  Pair pair;
  ExpectFastIsPlain(pair);
  pair.Mask(0, 0);
  pair.Mask(20, 11);
  ExpectFastIsPlain(pair);
}

// A flat white picture has no variance: float's G x^2 - (G x)^2 may be below 0, by less than
// C2.
TEST(PictureLoss, AFlatPictureIsSound) {
  std::vector<uint16_t> photo(3 * 64 * 64, 65535);
  std::vector<float> picture(photo.size(), 1.0f), d(photo.size());
  LossRows rows;
  const PictureSums sums =
      Compare(64, 64, photo.data(), nullptr, picture.data(), 0.2f, &rows, d.data());
  EXPECT_NEAR(sums.similarity, 3 * 64 * 64, 1);
  for (const float value : d) EXPECT_LT(std::abs(value), 1e-7f);
}

}  // namespace
}  // namespace regrade
