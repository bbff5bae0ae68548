// The lens's falloff from colours of points: planted, absent, with gains and outliers.
#include "reconstruct/refinement/lens_falloff.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "kernels/base/random.h"

namespace regrade {
namespace {

constexpr int kPhotos = 12, kPlaces = 600;

// Each point in half of the photos, anywhere in them; 2 % of noise; a tenth are other surfaces.
std::vector<ColorObservation> Observations(const std::function<double(double)>& falloff,
                                           double gain_spread) {
  std::vector<ColorObservation> observations;
  const auto random = [](uint64_t a, uint64_t b, uint64_t c) { return RandomDouble(a, b, c); };
  for (int p = 0; p < kPlaces; ++p)
    for (int v = 0; v < kPhotos; ++v) {
      const auto key = static_cast<uint64_t>(p * kPhotos + v);
      if (random(1, key, 0) < 0.5) continue;
      const double x = random(2, key, 0), y = random(2, key, 1);
      ColorObservation o{v, p, {}, p % kExposureFolds, Radius2(640, 480, 640 * x, 480 * y)};
      const double gain =
                       std::exp(gain_spread * (random(3, static_cast<uint64_t>(v), 0) - 0.5)),
                   other = random(4, key, 0) < 0.1 ? 0.3 : 1;
      for (int c = 0; c < 3; ++c) {
        const double color =
            0.1 + 0.7 * random(5, static_cast<uint64_t>(p), static_cast<uint64_t>(c));
        const double noise = 0.07 * (random(6, key, static_cast<uint64_t>(c)) - 0.5);
        o.light[c] = color * other * gain * falloff(o.radius2) * std::exp(noise);
      }
      observations.push_back(o);
    }
  return observations;
}

// A vignette of -1.5 stops in the corners, written as lens makers do, not as it is estimated.
double Vignette(double r2) { return 1 - 0.9 * r2 + (std::exp2(-1.5) - 0.1) * r2 * r2; }

TEST(LensFalloff, APlantedVignetteIsFoundToTwoPercent) {
  for (const double spread : {0.0, 0.5}) {
    const FalloffEstimate found = EstimateFalloff(kPhotos, Observations(Vignette, spread));
    EXPECT_GT(1 - found.corner, found.Threshold());
    EXPECT_GT(found.explained, 3 * found.explained_error);
    for (const double r : {0.25, 0.5, 0.75, 0.9, 1.0})
      EXPECT_NEAR(std::exp(found.falloff.LogAt(r * r)) / Vignette(r * r), 1, 0.02) << r;
    EXPECT_LT(found.corner_error, 0.02);
  }
}

TEST(LensFalloff, GainsAreFoundBesideIt) {
  const auto observations = Observations(Vignette, 0.5);
  const ExposureEstimate clean =
      EstimateExposure(kPhotos, Observations([](double) { return 1; }, 0.5));
  const ExposureEstimate found = EstimateExposure(
      kPhotos, WithoutFalloff(observations, EstimateFalloff(kPhotos, observations).falloff));
  for (int v = 0; v < kPhotos; ++v)
    EXPECT_NEAR(found.photos[static_cast<size_t>(v)].gain.x /
                    clean.photos[static_cast<size_t>(v)].gain.x,
                1, 0.01);
}

TEST(LensFalloff, ALensWithoutItKeepsItsLight) {
  for (const double spread : {0.0, 0.5}) {
    const FalloffEstimate found =
        EstimateFalloff(kPhotos, Observations([](double) { return 1; }, spread));
    EXPECT_LT(1 - found.corner, found.Threshold());
    EXPECT_GT(found.corner, 0.97);
  }
}

// Photos that were brightened in their corners too much have a lens without falloff.
TEST(LensFalloff, NeverBrightensOutwards) {
  const FalloffEstimate found =
      EstimateFalloff(kPhotos, Observations([](double r2) { return 1 + 0.3 * r2; }, 0.2));
  EXPECT_EQ(found.corner, 1);
  const FalloffEstimate bulge = EstimateFalloff(
      kPhotos, Observations([](double r2) { return 1 + r2 * (0.6 - r2); }, 0.2));
  EXPECT_EQ(bulge.falloff.a, 0);
  EXPECT_LT(bulge.corner, 1);
}

TEST(LensFalloff, WithoutPointsItIsUnknown) {
  EXPECT_EQ(EstimateFalloff(3, {}).falloff, LensFalloff());
}

}  // namespace
}  // namespace regrade
