// Exposures estimated from the colours of shared points, compared with known ones.
#include "reconstruct/refinement/exposure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "kernels/base/random.h"
#include "reconstruct/refinement/exposure_folds.h"
#include "reconstruct/refinement/exposure_model.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

constexpr int kViews = 12, kPoints = 400, kTrack = 5;

double Normal(uint64_t stream, uint64_t counter) {
  return std::sqrt(-2 * std::log(1 - RandomDouble(7, stream, 2 * counter))) *
         std::cos(2 * M_PI * RandomDouble(7, stream, 2 * counter + 1));
}

// Log gains within +- `range`, zero on average in each channel.
std::vector<Vec3d> KnownLogs(double range) {
  std::vector<Vec3d> logs(kViews);
  Vec3d mean;
  for (int v = 0; v < kViews; ++v) {
    for (int c = 0; c < 3; ++c)
      logs[static_cast<size_t>(v)][c] =
          range * (2 * RandomDouble(1, static_cast<uint64_t>(c), static_cast<uint64_t>(v)) - 1);
    mean += logs[static_cast<size_t>(v)] / kViews;
  }
  for (Vec3d& log : logs) log = log - mean;
  return logs;
}

// Each point is seen by kTrack successive photos, with noise `sigma` in each log channel. With
// `outliers`, a tenth of the observations is up to four times as bright or dark.
std::vector<ColorObservation> Observations(const std::vector<Vec3d>& logs, double sigma,
                                           bool outliers) {
  std::vector<ColorObservation> observations;
  for (int p = 0; p < kPoints; ++p)
    for (int k = 0; k < kTrack; ++k) {
      const int v = (p + k) % kViews;
      const auto counter = static_cast<uint64_t>(p * kTrack + k);
      const double wrong =
          outliers && counter % 10 == 3 ? 2.8 * (RandomDouble(2, 0, counter) - 0.5) : 0;
      ColorObservation o{v, p, {}, p % kExposureFolds};
      for (int c = 0; c < 3; ++c) {
        const double color = std::log(
            0.05 + 0.5 * RandomDouble(3, static_cast<uint64_t>(c), static_cast<uint64_t>(p)));
        o.light[c] = std::exp(color + logs[static_cast<size_t>(v)][c] + wrong +
                              sigma * Normal(static_cast<uint64_t>(c), counter));
      }
      observations.push_back(o);
    }
  return observations;
}

TEST(Exposure, RecoversKnownGainsWithOutliers) {
  const std::vector<Vec3d> truth = KnownLogs(0.4);
  const ExposureEstimate estimate =
      EstimateExposure(kViews, Observations(truth, 0.03, /*outliers=*/true));
  double chi_squared = 0;
  for (int v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c) {
      const PhotoExposure& photo = estimate.photos[static_cast<size_t>(v)];
      EXPECT_TRUE(photo.known);
      const double error = std::log(photo.gain[c]) - truth[static_cast<size_t>(v)][c];
      EXPECT_LT(std::abs(error), testing::RecordBound("log gain among outliers",
                                                      testing::Computed::kDouble, error, 0.02))
          << "photo " << v << " channel " << c;
      // 0.03 / sqrt(167 observations) = 0.0023, and more because the colours are unknown.
      // A jackknife over 16 parts has an error of 18 %; the bounds allow a factor of 2 and
      // more.
      EXPECT_GT(photo.log_error[c], 0.0012);
      EXPECT_LT(photo.log_error[c], 0.007);
      chi_squared += error * error / (photo.log_error[c] * photo.log_error[c]);
    }
  // Errors over standard errors: 1 on average; a factor of 1.5 for chance (36 values) and
  // outliers.
  EXPECT_GT(std::sqrt(chi_squared / (3 * kViews)), 1 / 1.5);
  EXPECT_LT(std::sqrt(chi_squared / (3 * kViews)), 1.5);
  EXPECT_TRUE(estimate.Pays());
  EXPECT_GT(estimate.explained, 0.5);
}

TEST(Exposure, LogGainsHaveMeanZeroInEachChannel) {
  std::vector<Vec3d> logs = KnownLogs(0.4);
  for (Vec3d& log : logs)
    log += Vec3d{0.5, -0.2, 0.1};  // indistinguishable from a brighter scene
  const ExposureEstimate estimate = EstimateExposure(kViews, Observations(logs, 0.03, true));
  for (int c = 0; c < 3; ++c) {
    double sum = 0;
    for (const PhotoExposure& photo : estimate.photos) sum += std::log(photo.gain[c]);
    EXPECT_NEAR(sum, 0, 1e-12);
  }
}

TEST(Exposure, EqualPhotosStayUnderTheThreshold) {
  const ExposureEstimate estimate =
      EstimateExposure(kViews, Observations(KnownLogs(0), 0.03, true));
  EXPECT_FALSE(estimate.Pays());
  EXPECT_LT(std::abs(estimate.explained), 0.01);
  // Few observations and much noise: the spread is noise, as the points left out show.
  std::vector<ColorObservation> few = Observations(KnownLogs(0), 0.3, false);
  std::erase_if(few, [](const ColorObservation& o) { return o.point >= 60; });
  const ExposureEstimate noisy = EstimateExposure(kViews, few);
  EXPECT_GT(noisy.spread, kExposureSpread);
  EXPECT_LT(noisy.explained, 0);
  EXPECT_FALSE(noisy.Pays());
}

TEST(Exposure, PhotoWithoutObservationsKeepsItsExposure) {
  std::vector<ColorObservation> observations = Observations(KnownLogs(0.4), 0.03, false);
  std::erase_if(observations, [](const ColorObservation& o) { return o.view == 4; });
  for (int p = 0; p < kFewestColors - 1; ++p)
    observations.push_back({4, p, {0.2, 0.2, 0.2}, p % kExposureFolds});
  const ExposureEstimate estimate = EstimateExposure(kViews + 1, observations);
  for (const size_t unknown : {size_t{4}, size_t{kViews}}) {
    EXPECT_FALSE(estimate.photos[unknown].known);
    EXPECT_EQ(estimate.photos[unknown].gain, (Vec3d{1, 1, 1}));
  }
  EXPECT_TRUE(estimate.photos[3].known);
  EXPECT_FALSE(EstimateExposure(3, {}).photos[2].known);
  EXPECT_EQ(EstimateExposure(3, {}).spread, 0);
}

TEST(Exposure, EachGroupWithoutCommonPointsHasMeanZero) {
  const std::vector<Vec3d> truth = KnownLogs(0.4);
  std::vector<ColorObservation> twice = Observations(truth, 0.01, false);
  for (ColorObservation o : Observations(truth, 0.01, false)) {
    o.view += kViews, o.point += kPoints;
    o.light = 3.0 * o.light;  // indistinguishable from a brighter scene
    twice.push_back(o);
  }
  const ExposureEstimate estimate = EstimateExposure(2 * kViews, twice);
  for (size_t v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(estimate.photos[v].gain[c], estimate.photos[v + kViews].gain[c], 1e-6);
      EXPECT_LT(estimate.photos[v].log_error[c], 0.003);
    }
}

// Errors of neighbouring points are correlated, as with misplaced points or reflections: here
// each part of the scene has one error in each photo. Errors computed for independent
// observations would be too small by sqrt(25 points per part and photo).
TEST(Exposure, StandardErrorsHoldWhereNeighboursErrAlike) {
  const std::vector<Vec3d> truth = KnownLogs(0.4);
  std::vector<ColorObservation> observations = Observations(truth, 0.01, false);
  for (ColorObservation& o : observations)
    for (int c = 0; c < 3; ++c)
      o.light[c] *= std::exp(0.05 * Normal(40 + static_cast<uint64_t>(c),
                                           static_cast<uint64_t>(o.fold * kViews + o.view)));
  const ExposureEstimate estimate = EstimateExposure(kViews, observations);
  double chi_squared = 0;
  for (size_t v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c) {
      const PhotoExposure& photo = estimate.photos[v];
      const double error = std::log(photo.gain[c]) - truth[v][c];
      chi_squared += error * error / (photo.log_error[c] * photo.log_error[c]);
    }
  // 1 on average; jackknife errors of 16 parts have an error of 18 % each.
  EXPECT_GT(std::sqrt(chi_squared / (3 * kViews)), 1 / 1.5);
  EXPECT_LT(std::sqrt(chi_squared / (3 * kViews)), 1.5);
  EXPECT_TRUE(estimate.Pays());
}

// The brightness of a third of the scene varies by a half around the camera path, as
// reflections do. Gains that follow it make the other parts worse.
TEST(Exposure, H139_WhatShinesIsNoExposure) {
  std::vector<ColorObservation> observations = Observations(KnownLogs(0), 0.03, false);
  for (ColorObservation& o : observations)
    if (o.fold < 5) o.light = std::exp(0.5 * std::sin(2 * M_PI * o.view / kViews)) * o.light;
  const ExposureEstimate estimate = EstimateExposure(kViews, observations);
  EXPECT_GT(estimate.spread, kExposureSpread);  // it looks like exposure
  EXPECT_LT(estimate.explained, kExposurePays);
  EXPECT_FALSE(estimate.Pays());
}

TEST(Exposure, ReweightingFindsTheMinimumOfCeres) {
  const std::vector<ColorObservation> observations = Observations(KnownLogs(0.4), 0.03, true);
  const ExposureEstimate estimate = EstimateExposure(kViews, observations);
  const LogColors gains =
      ReweightedGains(ArrangeObservations(kViews, observations), kNoFold, LogColors(kViews));
  for (size_t v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c)  // each converges to about a thousandth of a standard error
      EXPECT_NEAR(gains[v][c], std::log(estimate.photos[v].gain[c]), 2e-4);
}

TEST(ExposureFolds, PartsHaveEqualSizeAndAreCompact) {
  std::vector<Vec3d> positions;
  for (uint64_t i = 0; i < 1600; ++i)
    positions.push_back(
        {4 * RandomDouble(5, 0, i), RandomDouble(5, 1, i), RandomDouble(5, 2, i)});
  const std::vector<int> folds = SpatialFolds(positions, 4);
  for (int fold = 0; fold < 16; ++fold) {
    EXPECT_EQ(std::count(folds.begin(), folds.end(), fold), 100);
    double low = 4, high = 0;
    for (size_t i = 0; i < positions.size(); ++i)
      if (folds[i] == fold)
        low = std::min(low, positions[i].x), high = std::max(high, positions[i].x);
    EXPECT_LT(high - low, 1.2);  // a quarter of the length, plus chance
  }
  EXPECT_EQ(SpatialFolds({}, 4).size(), 0u);
  EXPECT_EQ(SpatialFolds({{1, 2, 3}}, 4).size(), 1u);
}

// Photos and points in another order give the same minimum, to the solver's tolerance.
TEST(Exposure, H154_OrderOfPhotosDoesNotMatter) {
  const std::vector<ColorObservation> observations = Observations(KnownLogs(0.4), 0.03, true);
  std::vector<ColorObservation> permuted;
  for (const ColorObservation& o : observations)
    permuted.push_back({(5 * o.view + 3) % kViews, kPoints - 1 - o.point, o.light, o.fold});
  std::stable_sort(permuted.begin(), permuted.end(),
                   [](const auto& a, const auto& b) { return a.view < b.view; });
  const ExposureEstimate one = EstimateExposure(kViews, observations);
  const ExposureEstimate other = EstimateExposure(kViews, permuted);
  EXPECT_NEAR(one.spread, other.spread,
              testing::RecordBound("spread of reordered photos", testing::Computed::kDouble,
                                   one.spread - other.spread, 1e-6));
  EXPECT_NEAR(one.explained, other.explained, 1e-5);
  for (int v = 0; v < kViews; ++v)
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(one.photos[static_cast<size_t>(v)].gain[c],
                  other.photos[static_cast<size_t>((5 * v + 3) % kViews)].gain[c], 1e-6);
}

}  // namespace
}  // namespace regrade
