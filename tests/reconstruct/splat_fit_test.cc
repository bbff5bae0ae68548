// Fits of splats: the population's arithmetic, convergence, the same bits for any number of
// threads and after a stop.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "kernels/field/spherical_harmonics.h"
#include "kernels/splats/extent.h"
#include "kernels/splats/seen_depth.h"
#include "reconstruct/splats/fit_splats.h"
#include "reconstruct/splats/population.h"
#include "reconstruct/splats/splat_engine.h"
#include "reconstruct/splats/splat_photos.h"
#include "tests/support/ball_views.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

// --- relocation

// Opacity of n splats in a row at their middle, and the integral along a line through it, by
// numbers: T (1 - (1 - o' e^(-x^2 / 2 s'^2))^n) over x.
TEST(Relocation, CopiesLookAsTheOneDid) {
  for (const double opacity : {0.006, 0.3, 0.9, 0.9999})
    for (const int n : {2, 3, 10, kMostCopies}) {
      const SplatCopies each = CopiesOf(opacity, n);
      EXPECT_NEAR(1 - std::pow(1 - each.opacity, n), opacity, 1e-12) << n;
      double integral = 0;
      constexpr double kStep = 1e-3;
      for (double x = -12; x < 12; x += kStep) {
        const double wide = x * std::exp(-each.log_scale);
        integral += kStep * (1 - std::pow(1 - each.opacity * std::exp(-wide * wide / 2), n));
      }
      EXPECT_NEAR(integral, opacity * std::sqrt(2 * M_PI), 1e-6) << opacity << ' ' << n;
    }
}

TEST(Relocation, OneCopyIsTheSplat) {
  const SplatCopies each = CopiesOf(0.37, 1);
  EXPECT_DOUBLE_EQ(each.opacity, 0.37);
  EXPECT_NEAR(each.log_scale, 0, 1e-15);
}

// --- population

float LogitOf(double opacity) {
  return static_cast<float>(std::log(opacity) - std::log1p(-opacity));
}

TEST(Population, TheDeadMoveToOthersByOpacity) {
  std::vector<float> logits(1000, LogitOf(0.001));
  for (size_t i = 0; i < logits.size(); i += 4) logits[i] = LogitOf(i % 8 == 0 ? 0.8 : 0.1);
  logits[1] = std::numeric_limits<float>::quiet_NaN();
  const PopulationChange change = MoveDead(logits, 3, 7);
  EXPECT_EQ(change.count, 1000);
  EXPECT_EQ(change.copies.size(), 750u);
  int64_t opaque = 0;
  std::set<int32_t> places, sources;
  for (const SplatCopy& copy : change.copies) {
    EXPECT_NE(copy.to % 4, 0);
    EXPECT_EQ(copy.from % 4, 0);
    opaque += copy.from % 8 == 0;
    places.insert(copy.to);
    sources.insert(copy.from);
  }
  EXPECT_EQ(places.size(), 750u);
  EXPECT_EQ(sources.size(), change.copied.size());
  // Binomial with p = 0.8 / 0.9: 667 +- 4 x 8.6.
  EXPECT_NEAR(static_cast<double>(opaque), 750 * 8.0 / 9, 35);
  for (const CopiedSplat& copied : change.copied) {
    EXPECT_LT(copied.opacity_logit, logits[static_cast<size_t>(copied.index)]);
    EXPECT_LT(copied.log_factor, 0);
  }
}

TEST(Population, NothingMovesWhereAllAreDeadOrNone) {
  EXPECT_TRUE(MoveDead(std::vector<float>(10, -20.0f), 1, 1).copies.empty());
  EXPECT_TRUE(MoveDead(std::vector<float>(10, 1.0f), 1, 1).copies.empty());
  EXPECT_TRUE(Grow(std::vector<float>(10, -20.0f), 5, 1, 1).copies.empty());
}

// One source for many: no more than kMostCopies of it, and no gaps among the new ones.
TEST(Population, GrowthIsLimitedPerSplat) {
  std::vector<float> logits(10, -20.0f);
  logits[4] = 0;
  const PopulationChange change = Grow(logits, 1000, 1, 1);
  ASSERT_EQ(change.copies.size(), static_cast<size_t>(kMostCopies - 1));
  EXPECT_EQ(change.count, 10 + kMostCopies - 1);
  for (size_t k = 0; k < change.copies.size(); ++k)
    EXPECT_EQ(change.copies[k].to, static_cast<int32_t>(10 + k));
}

// --- update

// Noise has the covariance of the splat: E x x^T = noise^2 Sigma Sigma, far below kDeadOpacity,
// where its share is 1 / (1 + exp(-0.5)).
TEST(SplatNoise, HasTheSplatsShape) {
  SplatUpdate update;
  update.noise = 2;
  update.seed = 5;
  Splat<float> splat;
  splat.log_scale = {std::log(1.0f), std::log(0.5f), std::log(0.1f)};
  splat.quaternion[0] = 1, splat.quaternion[3] = 1;  // a quarter turn about z
  splat.opacity_logit = -30;
  constexpr int kCount = 100000;
  Vec3d square{};
  for (int i = 0; i < kCount; ++i) {
    float mean[3] = {};
    AddSplatNoise(update, i, splat, mean);
    for (int a = 0; a < 3; ++a) square[a] += double{mean[a]} * mean[a];
  }
  const double share = 2 / (1 + std::exp(-0.5));
  const double expected[3] = {0.25 * share, 1 * share, 0.01 * share};
  for (int a = 0; a < 3; ++a)
    EXPECT_NEAR(std::sqrt(square[a] / kCount), expected[a], 0.01 * expected[a]) << a;
  splat.opacity_logit = 0;  // and none where it is opaque
  float mean[3] = {};
  AddSplatNoise(update, 1, splat, mean);
  EXPECT_EQ(mean[0], 0);
}

TEST(UpdateSplat, AGradientThatIsNotFiniteChangesNothing) {
  Splats splats(2, 4), first(2, 4), second(2, 4);
  const SplatMoments to{PointersOf(&splats), PointersOf(&first), PointersOf(&second)};
  SplatUpdate update;
  update.rates = {1, 1, 1, 1, 1, 1};
  update.SetStep(0);
  Splat<float> d{};
  d.quaternion[3] = std::numeric_limits<float>::infinity();
  d.mean.x = 1;
  EXPECT_FALSE(UpdateShape(update, 1, d, to));
  EXPECT_EQ(splats.mean[3], 0);
  d.quaternion[3] = 0;
  EXPECT_TRUE(UpdateShape(update, 1, d, to));
  EXPECT_FLOAT_EQ(splats.mean[3], -1);  // Adam's first step is the rate
  EXPECT_EQ(splats.mean[4], 0);
  EXPECT_FALSE(UpdateColor(update, true, std::numeric_limits<float>::quiet_NaN(), 5, to));
  EXPECT_EQ(splats.sh[5], 0);
}

// A first step of Adam is its rate.
TEST(UpdateSplat, FarMeansMoveInProportionToTheirDistance) {
  for (const float place : {6.0f, 7.0f, 9.0f, 15.0f}) {
    Splats splats(1, 1), first(1, 1), second(1, 1);
    splats.mean = {place, 0, 0};
    splats.quaternion[0] = 1;
    SplatUpdate update;
    update.rates = {.mean = 0.02f, .middle = {5, 0, 0}, .reach = 2};
    update.SetStep(0);
    EXPECT_TRUE(UpdateShape(update, 0, {.mean = {-3, 0, 0}},
                            {PointersOf(&splats), PointersOf(&first), PointersOf(&second)}));
    const float far = std::max(place - 5, 2.0f);
    EXPECT_NEAR(splats.mean[0], place + 0.01f * far, 1e-5f) << place;
  }
}

// Of the losses lambda_o sum sigmoid(x) and lambda_s sum exp(l), by differences in double;
// Adam's first moment after a step from 0 is a tenth of the gradient.
TEST(UpdateSplat, RegularisersHaveTheirGradient) {
  Splats splats(1, 1), first(1, 1), second(1, 1);
  splats.opacity_logit[0] = -1.5f;
  splats.log_scale = {-3, -1, 0.5f};
  splats.quaternion[0] = 1;
  SplatUpdate update;
  update.opacity_weight = 0.3f;
  update.scale_weight = 0.2f;
  update.SetStep(0);
  EXPECT_TRUE(UpdateShape(update, 0, {},
                          {PointersOf(&splats), PointersOf(&first), PointersOf(&second)}));
  const auto sigmoid = [](double x) { return 1 / (1 + std::exp(-x)); };
  constexpr double kStep = 1e-6;
  EXPECT_NEAR(first.opacity_logit[0] / 0.1,
              0.3 * (sigmoid(-1.5 + kStep) - sigmoid(-1.5 - kStep)) / (2 * kStep), 1e-7);
  const double scales[3] = {-3, -1, 0.5};
  for (size_t a = 0; a < 3; ++a)
    EXPECT_NEAR(first.log_scale[a] / 0.1, 0.2 * std::exp(scales[a]), 1e-7) << a;
}

// Whichever way a step is made, by coefficients or by rows.
TEST(UpdateSplat, ColoursStayWithinTheirBounds) {
  SplatUpdate update;
  update.rates.sh_mean = update.rates.sh_rest = 5;
  update.SetStep(0);
  const float d[12] = {1, 1, -1, 1, -1, 1, 1, 1, -1, 1, 1, 1};
  Splats rows(1, 4), each(1, 4);
  for (Splats* splats : {&rows, &each}) {
    Splats first(1, 4), second(1, 4);
    const SplatMoments to{PointersOf(splats), PointersOf(&first), PointersOf(&second)};
    if (splats == &rows) {
      EXPECT_TRUE(UpdateColors(update, 0, 4, d, to));
    }
    for (int k = 0; k < 12 && splats == &each; ++k)
      EXPECT_TRUE(UpdateColor(update, k % 4 == 0, d[k], k, to));
    for (size_t k = 0; k < 12; ++k)
      EXPECT_FLOAT_EQ(splats->sh[k] * d[k], k % 4 == 0 ? -std::sqrt(M_PI) : -0.2) << k;
  }
}

// --- depths

TEST(SeenDepth, GradientIsTheDerivativeInDouble) {
  const SeenDepth seen{.pixel = 0, .depth = 3, .error = 0.02f};
  constexpr double kStep = 1e-6;
  const auto loss = [&seen](double z, double transmittance) {
    double unused[2];
    return DepthLoss(seen, 5, z, transmittance, unused, unused + 1);
  };
  for (const double z : {0.0, 2.5, 2.96, 3.01, 3.05, 9.0, 300.0})
    for (const double t : {0.0, 0.01, 0.4}) {
      double d_z, d_t;
      EXPECT_GT(DepthLoss(seen, 5, z, t, &d_z, &d_t), 0);
      EXPECT_NEAR(d_z, (loss(z + kStep, t) - loss(z - kStep, t)) / (2 * kStep), 1e-7) << z;
      EXPECT_NEAR(d_t, (loss(z, t + kStep) - loss(z, t - kStep)) / (2 * kStep), 1e-7) << z;
    }
}

// A thin wall before something far that has its colour, which photos alone cannot tell from an
// opaque one: with points on the wall the light comes from there.
TEST(SeenDepth, PointsMakeWallsOpaque) {
  constexpr int kSide = 24;
  Image photo(kSide, kSide);
  std::ranges::fill(photo.pixels, 0.7f);
  Camera camera;
  camera.width = camera.height = kSide;
  camera.fx = camera.fy = camera.cx = camera.cy = kSide / 2;
  std::vector<SeenPoint> points;
  for (int y = -2; y <= 2; ++y)
    for (int x = -2; x <= 2; ++x)
      points.push_back({{0.7f * static_cast<float>(x), 0.7f * static_cast<float>(y), 2}, 0.1f});
  points.push_back({{0, 0, -2}, 0.01f});      // behind the camera
  points.push_back({{0.01f, 0, 2}, 0.001f});  // in the pixel of another, and more certain
  const std::vector<TrainingView> views = {{camera, &photo, points}};
  const SplatPhotos photos(views);
  ASSERT_EQ(photos[0].depths.size(), 25u);
  EXPECT_FLOAT_EQ(photos[0].depths[11].error, 0.05f);
  EXPECT_EQ(photos[0].depths[12].error, kLeastDepthError);

  const auto fitted = [&photos, &camera](float depth_weight) {
    SplatFitState state;
    state.splats = Splats(2, 1);
    state.splats.Set(0, {{0, 0, 2}, {1, 1, -4}, {1, 0, 0, 0}, -1});
    state.splats.Set(1, {{0, 0, 12}, {3, 3, -2}, {1, 0, 0, 0}, 3});
    for (float& value : state.splats.sh) value = 0.2f / static_cast<float>(kSh0);
    state.splats.background = {0.7f, 0.7f, 0.7f};
    state.first_moment = state.second_moment = Splats(2, 1);
    const auto engine = MakeCpuSplatEngine({});
    engine->SetPhotos(&photos);
    engine->SetState(std::move(state));
    for (int i = 0; i < 200; ++i) {
      SplatStep step;
      step.depth_weight = depth_weight;
      step.update.rates.opacity_logit = 0.05f;
      step.update.SetStep(static_cast<uint64_t>(i));
      engine->Step(step);
    }
    return engine->Render(camera).depth.at(kSide / 2, kSide / 2)[0];
  };
  EXPECT_GT(fitted(0), 6);
  EXPECT_NEAR(fitted(SplatFitOptions().depth_weight), 2, 0.15);
}

// --- fits

class SplatFit : public testing::FitField {
 protected:
  void SetUp() override {
    FitField::SetUp();
    fit_.steps = 400;
    fit_.thousands = 2;
    fit_.sh_degree = 1;
    box_.background = truth_.background;
  }

  SplatFitResult FitWith(const SplatFitHooks& hooks = {}) const {
    return FitSplats(views_, box_, fit_, hooks);
  }
  static bool SameSplats(const Splats& a, const Splats& b) {
    return a.mean == b.mean && a.log_scale == b.log_scale && a.quaternion == b.quaternion &&
           a.opacity_logit == b.opacity_logit && a.sh == b.sh;
  }

  SplatFitOptions fit_;
};

TEST_F(SplatFit, ReproducesAHeldOutView) {
  SplatFitHooks hooks;
  double psnr = 0;
  hooks.measure = [&](SplatEngine* engine) {
    psnr = DecibelsBetween(engine->Render(cameras_[0]).color, photos_[0]);
  };
  const SplatFitResult result = FitWith(hooks);
  EXPECT_EQ(result.rejected, 0);
  EXPECT_EQ(result.splats.basis, 4);
  Validate(result.splats, "fit");
  Image background(48, 48);
  for (size_t i = 0; i < background.pixels.size(); ++i)
    background.pixels[i] = truth_.background[static_cast<int>(i % 3)];
  EXPECT_GT(psnr, DecibelsBetween(background, photos_[0]) + 12);
}

TEST_F(SplatFit, DegreeThreeIsFitted) {
  fit_.steps = 60;
  fit_.sh_degree = 3;
  const Splats splats = FitWith().splats;
  Validate(splats, "fit");
  ASSERT_EQ(splats.basis, 16);
  std::set<int> moved;
  for (size_t i = 0; i < splats.sh.size(); ++i)
    if (splats.sh[i] != 0) moved.insert(static_cast<int>(i % 16));
  EXPECT_EQ(moved.size(), 16u);
}

// Both weights count more in long fits of few photos, and in no others.
TEST_F(SplatFit, LongFitsOfFewPhotosLeaveSmallerSplats) {
  fit_.steps = 200;
  const auto volume = [this](int long_from, int few_photos) {
    fit_.long_from = long_from;
    fit_.few_photos = few_photos;
    fit_.few_photos_weights = 8;
    const Splats splats = FitWith().splats;
    double sum = 0;
    for (const float value : splats.log_scale) sum += std::exp(double{value});
    return sum / static_cast<double>(splats.log_scale.size());
  };
  const int photos = static_cast<int>(std::ssize(views_));
  const double many = volume(0, photos);
  EXPECT_LT(volume(0, photos + 1), 0.9 * many);
  EXPECT_EQ(volume(1000, photos), volume(1000, photos + 1));
}

TEST_F(SplatFit, SameBitsForAnyThreadCount) {
  fit_.steps = 120;
  const auto with = [&](int n) {
    const testing::Threads threads(n);
    return FitWith().splats;
  };
  EXPECT_TRUE(testing::RecordSameBits("splats, 1 and 3 threads", testing::Computed::kFloat,
                                      SameSplats(with(1), with(3))));
}

TEST_F(SplatFit, AResumedFitIsTheUndisturbedOne) {
  fit_.steps = 120;
  fit_.small_until = 0.3f;
  const SplatFitResult straight = FitWith();
  for (const int stop_after : {1, 30, 77}) {
    SplatFitState saved;
    int done = 0;
    SplatFitHooks stop;
    stop.checkpoint = [&](const SplatFitState& state) { saved = state; };
    stop.progress = [&](const Progress&) {
      return ++done == stop_after ? LoopControl::kStop : LoopControl::kContinue;
    };
    EXPECT_THROW(FitWith(stop), Interrupted);
    SplatFitHooks resume;
    resume.resume = &saved;
    EXPECT_TRUE(SameSplats(FitWith(resume).splats, straight.splats)) << stop_after;
  }
}

TEST_F(SplatFit, MaskedPixelsHaveNoInfluence) {
  fit_.steps = 60;
  for (size_t i = 0; i < photos_.size(); ++i)
    for (int y = 0; y < 10; ++y)
      for (int x = 0; x < 10; ++x)
        photos_[i].at(x, y)[1] = std::numeric_limits<float>::quiet_NaN();
  const Splats masked = FitWith().splats;
  for (size_t i = 0; i < photos_.size(); ++i)
    for (int y = 0; y < 10; ++y)
      for (int x = 0; x < 10; ++x) photos_[i].at(x, y)[0] = 1;
  EXPECT_TRUE(SameSplats(masked, FitWith().splats));
}

}  // namespace
}  // namespace regrade
