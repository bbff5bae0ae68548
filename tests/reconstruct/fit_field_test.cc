// Fitting: converges, gives the same result for any number of threads and after a resume, and
// refuses an empty field.
#include "reconstruct/fit/fit_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "kernels/field/render.h"
#include "reconstruct/fit/choose_degree.h"
#include "reconstruct/fit/resample_grid.h"
#include "reconstruct/fit/sphere_grid.h"
#include "tests/support/ball_views.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

using testing::FitField;

TEST_F(FitField, ReproducesAHeldOutView) {
  const FitResult result = Fit();
  RadianceField empty = result.field;
  auto geometry = std::make_shared<Geometry>(*empty.geometry);
  for (float& density : geometry->density) density = -1;
  empty.geometry = geometry;
  // 6 dB is half of the error of the mean colour; a fit with a wrong pose or gradient does not
  // reach it.
  EXPECT_GT(HeldOutPsnr(result.field), HeldOutPsnr(empty) + 6.0);
  EXPECT_EQ(result.rejected_voxels, 0);
  EXPECT_EQ(result.rays, 120 * 1024);
}

TEST_F(FitField, SameBytesForAnyThreadCount) {
  EXPECT_TRUE(
      testing::RecordSameBits("1 and 3 threads", testing::Computed::kFloat,
                              SameBits(FitWithThreads(1).field, FitWithThreads(3).field)));
}

TEST_F(FitField, H109_H110_AResumedFitIsTheUndisturbedOne) {
  const FitResult straight = Fit();
  for (const int stop_after : {25, 60, 95, 113}) {
    FitState saved = StoppedFit(stop_after);
    const FitResult resumed = ResumedFit(&saved);
    EXPECT_EQ(saved.grid.records.size(), 0) << "a second state was kept";
    EXPECT_TRUE(testing::RecordSameBits("resumed and straight", testing::Computed::kFloat,
                                        SameBits(straight.field, resumed.field)))
        << stop_after;
    // Metrics include the steps before the interruption, bitwise.
    EXPECT_EQ(resumed.psnr_train_db, straight.psnr_train_db) << stop_after;
    EXPECT_EQ(resumed.rays, straight.rays);
    ASSERT_EQ(resumed.curve.size(), straight.curve.size());
    for (size_t i = 0; i < resumed.curve.size(); ++i) {
      EXPECT_EQ(resumed.curve[i].step, straight.curve[i].step);
      EXPECT_EQ(resumed.curve[i].psnr_train_db, straight.curve[i].psnr_train_db);
    }
  }
}

// The same ball in front of distant surroundings: the background of each photo depends on the
// ray's direction only, which neither a constant colour nor a box can model.
class FitSpheres : public FitField {
 protected:
  void SetUp() override {
    focal_ = 30;  // so wide that other views see all directions of the held-out one
    FitField::SetUp();
    for (size_t v = 0; v < cameras_.size(); ++v) {
      for (int y = 0; y < cameras_[v].height; ++y)
        for (int x = 0; x < cameras_[v].width; ++x) {
          float* pixel = photos_[v].at(x, y);
          // Pixels of the constant background.
          if (std::abs(pixel[0] - 0.2f) + std::abs(pixel[2] - 0.6f) > 1e-3f) continue;
          const Vec3f d = cameras_[v].PixelRay(x, y).direction;
          for (int c = 0; c < 3; ++c)
            pixel[c] = 0.5f + 0.4f * std::sin(5 * d[c] + 3 * d[(c + 1) % 3]);
        }
    }
    box_.radius = {2.9f, 2.9f, 2.9f};
    options_.background_layers = 16;
    options_.background_resolution = 32;
    options_.steps = {150, 150};
    // A small map in few steps: larger learning rates, and a sampling run of many texels.
    options_.rate_background_color = 0.3f;
    options_.rate_background_density = 3;
    options_.tv_background_fraction = 0.3f;
  }
};

TEST_F(FitSpheres, DistantSurroundingsAreFitted) {
  const double without = HeldOutPsnr(Fit().field);
  box_.far_surroundings = true;
  const FitResult with = Fit();
  EXPECT_TRUE(with.field.geometry->spheres.on());
  EXPECT_EQ(with.rejected_voxels, 0);
  // 3 dB is half of the squared error; 11.8 dB was measured.
  EXPECT_GT(HeldOutPsnr(with.field), without + 3);
}

TEST_F(FitSpheres, H109_H110_AResumedFitIsTheUndisturbedOne) {
  box_.far_surroundings = true;
  options_.steps = {40, 40};
  options_.background_lead = 0.5f;
  const FitResult straight = FitWithThreads(1);
  EXPECT_GT(straight.field.geometry->spheres.density.size(), 0);
  const testing::Threads threads(3);
  // Before, at and after the first step of the box; at the end of the stage; later.
  for (const int stop_after : {10, 20, 21, 40, 55}) {
    FitState saved = StoppedFit(stop_after);
    EXPECT_TRUE(testing::RecordSameBits("resumed and straight, before spheres",
                                        testing::Computed::kFloat,
                                        SameBits(straight.field, ResumedFit(&saved).field)))
        << stop_after;
  }
}

TEST_F(FitSpheres, ResamplingTheLayersKeepsConstants) {
  const TrainingRays rays(views_);
  const FastSpheres coarse = MakeInitialSpheres(
      rays, {{2, 2, 2}, {0, 0, 0}, {2.9f, 2.9f, 2.9f}}, 6, 16, 0.7f, {0.5f, 0.75f, 0.25f});
  ASSERT_GT(coarse.num_texels(), 100);
  const FastSpheres fine = ResampleSpheres(coarse, 33);
  EXPECT_GT(fine.num_texels(), 3 * coarse.num_texels());
  for (int64_t t = 0; t < fine.num_texels(); ++t) {
    EXPECT_NEAR(fine.texels[4 * t + 3], 0.7f, 1e-6f);
    EXPECT_NEAR(0.5f + 0.28209479f * fine.texels[4 * t + 1], 0.75f, 1e-6f);
  }
}

// Masked pixels (non-finite) are never drawn, for any square size, and batches keep their size.
// Single pixels are drawn with equal frequency.
TEST_F(FitField, MaskedPixelsAreNeverDrawn) {
  Image masked = photos_[1];
  int64_t masked_count = 0;
  const auto is_masked = [&](int x, int y) { return x > masked.width / 2 || (x + y) % 7 == 0; };
  for (int y = 0; y < masked.height; ++y)
    for (int x = 0; x < masked.width; ++x)
      if (is_masked(x, y)) {
        masked.at(x, y)[(x + y) % 3] = std::nanf("");
        ++masked_count;
      }
  ASSERT_GT(masked_count, 0);
  std::vector<TrainingView> views{{cameras_[1], &masked}, views_[1]};
  const TrainingRays rays(views);
  EXPECT_EQ(rays.num_rays(), 2 * masked.num_pixels() - masked_count);
  EXPECT_TRUE(AllFinite(rays.mean_color()));
  for (const int patch : {1, 4}) {
    std::map<std::array<float, 3>, int> times;  // by direction
    const int steps = patch == 1 ? 1600 : 40;
    for (int step = 0; step < steps; ++step) {
      std::vector<Ray> batch;
      std::vector<Vec3f> targets;
      rays.Draw(3, static_cast<uint64_t>(step), 64, patch, &batch, &targets);
      ASSERT_EQ(batch.size(), static_cast<size_t>(64 * patch * patch));
      for (const Vec3f& target : targets) EXPECT_TRUE(AllFinite(target));
      for (const Ray& ray : batch) ++times[{ray.direction.x, ray.direction.y, ray.direction.z}];
    }
    int drawn = 0;
    const double mean =
        32.0 * steps / static_cast<double>(masked.num_pixels() - masked_count);  // if equal
    for (int y = 0; y < masked.height; ++y)
      for (int x = 0; x < masked.width; ++x) {
        const Vec3f d = rays.RayOf(0, x, y).direction;
        const auto found = times.find({d.x, d.y, d.z});
        const int count = found == times.end() ? 0 : found->second;
        if (patch == 1 && !is_masked(x, y)) {
          EXPECT_NEAR(count, mean, 6 * std::sqrt(mean)) << x << ", " << y;
        }
        if (is_masked(x, y)) {
          EXPECT_EQ(count, 0) << x << ", " << y << ", squares of " << patch;
        }
        drawn += count;
      }
    EXPECT_NEAR(drawn, steps * 32 * patch * patch, steps * patch * patch);  // of two views
  }
  for (float& value : masked.pixels) value = std::nanf("");
  EXPECT_THROW(TrainingRays{views}, Error);
}

TEST(ExponentialRate, RunsFromBeginToEnd) {
  EXPECT_FLOAT_EQ(ExponentialRate(8, 0.5f, 0), 8);
  EXPECT_FLOAT_EQ(ExponentialRate(8, 0.5f, 0.5), 2);
  EXPECT_FLOAT_EQ(ExponentialRate(8, 0.5f, 1), 0.5f);
  EXPECT_EQ(ExponentialRate(0, 0.5f, 0.5), 0);
  // A fit of more steps than fit-rate-steps goes on at the last rate, as svox2's.
  EXPECT_FLOAT_EQ(ExponentialRate(8, 0.5f, 3), 0.5f);
}

TEST(DelayFactor, RisesFromAHundredthToOne) {
  EXPECT_FLOAT_EQ(DelayFactor(0, 200), 0.01f);
  EXPECT_NEAR(DelayFactor(100, 200), 0.01 + 0.99 * std::sqrt(0.5), 1e-6);
  EXPECT_EQ(DelayFactor(200, 200), 1);
  EXPECT_EQ(DelayFactor(0, 0), 1);
}

// Frames and styles march on where the fit stopped early, and no less far than it did.
TEST(MarchOfField, NoRayOfTheFitEndsLater) {
  FitOptions fit{.step = 0.75f, .stop_transmittance = 1e-3f};
  EXPECT_EQ(MarchOfField(fit).step, 0.75f);
  EXPECT_EQ(MarchOfField(fit).stop_transmittance, 1e-4f);
  fit.stop_transmittance = 1e-7f;
  EXPECT_EQ(MarchOfField(fit).stop_transmittance, 1e-7f);
}

TEST_F(FitField, H85_PruningEverythingIsAnError) {
  options_.prune_weight = 100;
  EXPECT_REGRADE_ERROR(Fit(), ExitCode::kScene, "prune-weight");
}

TEST_F(FitField, H85_ResamplingKeepsConstantsAndRamps) {
  const TrainingRays rays(views_);
  FastGrid grid = MakeInitialGrid(rays, {{9, 9, 9}, {0, 0, 0}, {1, 1, 1}}, 4, 0.3f, 0, 1);
  for (int64_t v = 0; v < grid.num_voxels(); ++v)
    for (int l = 0; l < 12; ++l)  // the first one a ramp along z
      grid.records[v * grid.lanes() + l] =
          l == 0 ? static_cast<float>(grid.vertex_of_voxel[v] % 9) : 0.25f;
  Buffer<float> weights(grid.num_voxels());
  for (float& w : weights) w = 1;
  const FastGrid fine = Resample(grid, weights, 0.5f, {17, 17, 17});
  ASSERT_GT(fine.num_voxels(), 1000);
  int whole = 0;
  for (int64_t v = 0; v < fine.num_voxels(); ++v) {
    // Values fade towards 0 next to empty vertices and are constant elsewhere.
    const float density = fine.records[v * fine.lanes() + DensityLane(4)];
    EXPECT_LE(density, 0.3f + 1e-6f);
    const bool inside = std::abs(density - 0.3f) < 1e-6f;
    whole += inside;
    // Vertex k of 17 is at (k + 1/2) 9 / 17 - 1/2 of 9, and ramps end at the last vertices.
    const float z =
        std::clamp((fine.vertex_of_voxel[v] % 17 + 0.5f) * 9 / 17 - 0.5f, 0.0f, 8.0f);
    if (inside) {
      EXPECT_NEAR(fine.records[v * fine.lanes()], z,
                  testing::RecordBound("a ramp resampled", testing::Computed::kFloat,
                                       fine.records[v * fine.lanes()] - z, 1e-5));
    }
  }
  EXPECT_GT(whole, fine.num_voxels() / 2);
}

// A matte ball in voxels as small as its pixels: one colour per position is enough.
TEST_F(FitField, AMatteSceneNeedsNoViewDependence) {
  const DegreeTrial trial = TryDegrees(views_, {}, options_, {}, Backend::kCpu);
  EXPECT_FALSE(trial.Pays()) << trial.gain_db << " dB";
}

TEST_F(FitField, ATrialIgnoresMaskedPixels) {
  for (Image& photo : photos_)
    for (int y = 0; y < photo.height / 2; ++y)
      for (int x = 0; x < photo.width / 3; ++x) photo.at(x, y)[1] = std::nanf("");
  const DegreeTrial trial = TryDegrees(views_, {}, options_, {}, Backend::kCpu);
  EXPECT_TRUE(std::isfinite(trial.gain_db));
  EXPECT_FALSE(trial.Pays()) << trial.gain_db << " dB";
}

// The same ball, brighter when seen from one side.
TEST_F(FitField, AShinySceneNeedsViewDependence) {
  RadianceField shiny = truth_;
  shiny.appearance.basis = 4;
  shiny.appearance.sh = Buffer<float>(4 * truth_.appearance.sh.size());
  for (int64_t i = 0; i < truth_.appearance.sh.size(); ++i) {
    shiny.appearance.sh[4 * i] = truth_.appearance.sh[i];
    shiny.appearance.sh[4 * i + 1] = shiny.appearance.sh[4 * i + 3] = 0.15f;
    shiny.appearance.sh[4 * i + 2] = 0;
  }
  for (size_t i = 0; i < photos_.size(); ++i)
    photos_[i] = RenderViewPlain(shiny, cameras_[i], {0.5f, 1e-4f}).color;
  const DegreeTrial trial = TryDegrees(views_, {}, options_, {}, Backend::kCpu);
  EXPECT_TRUE(trial.Pays()) << trial.gain_db << " dB";
  views_.resize(kLeastTrialViews - 1);  // too few for held-out views
  EXPECT_TRUE(TryDegrees(views_, {}, options_, {}, Backend::kCpu).Pays());
}

}  // namespace
}  // namespace regrade
