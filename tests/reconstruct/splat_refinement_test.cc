// Fits that go on from splats of which some stay as they are.
#include <gtest/gtest.h>

#include <algorithm>

#include "reconstruct/splats/fit_splats.h"
#include "reconstruct/splats/population.h"
#include "reconstruct/splats/splat_engine.h"
#include "tests/support/ball_views.h"

namespace regrade {
namespace {

TEST(UpdateSplat, MeansDoNotLeaveWhereTheyAreHeld) {
  for (const float limit : {4.0f, 6.0f}) {
    Splats splats(1, 1), first(1, 1), second(1, 1);
    splats.mean = {5, 0, 0};
    splats.quaternion[0] = 1;
    SplatUpdate update;
    update.rates = {2, 1, 1, 1, 1, 1};
    update.hold.low.x = limit;
    update.SetStep(0);
    Splat<float> d{};
    d.mean.x = d.opacity_logit = 1;
    EXPECT_TRUE(UpdateShape(update, 0, d,
                            {PointersOf(&splats), PointersOf(&first), PointersOf(&second)}));
    EXPECT_EQ(splats.mean[0], 5) << limit;
    EXPECT_FLOAT_EQ(splats.opacity_logit[0], -1) << limit;
  }
}

// Without a gradient Adam takes the regularizers' for a direction, and steps as far as ever.
TEST(UpdateSplat, WhatNoPhotoHasChangedMayBeSparedTheRegularizers) {
  for (const bool spare : {false, true}) {
    Splats splats(2, 1), first(2, 1), second(2, 1);
    second.opacity_logit[1] = 1e-3f;  // a photo has
    splats.quaternion[0] = splats.quaternion[4] = 1;
    SplatUpdate update;
    update.rates = {0.1f, 0.1f, 0.1f, 0.1f, 0.1f, 0.1f};
    update.opacity_weight = update.scale_weight = 1e-9f;
    update.spare_unseen = spare;
    const SplatMoments to{PointersOf(&splats), PointersOf(&first), PointersOf(&second)};
    for (uint64_t step = 2000; step < 2020; ++step) {
      update.SetStep(step);
      for (int64_t i = 0; i < 2; ++i) EXPECT_TRUE(UpdateShape(update, i, {}, to));
    }
    if (spare) {
      EXPECT_EQ(splats.opacity_logit[0], 0);
      EXPECT_EQ(splats.log_scale[0], 0);
    } else {
      EXPECT_LT(splats.opacity_logit[0], -1);
      EXPECT_LT(splats.log_scale[0], -1);
    }
    EXPECT_LT(splats.opacity_logit[1], 0);
    EXPECT_GT(splats.opacity_logit[1], -1e-5f);
  }
}

TEST(Population, ChangesBehindOthersAreTheSameFurtherOn) {
  std::vector<float> logits(100, 1.0f);
  for (size_t i = 0; i < logits.size(); i += 3) logits[i] = -20;
  const PopulationChange own = MoveDead(logits, 3, 7), behind = Behind(50, own);
  EXPECT_EQ(behind.count, own.count + 50);
  ASSERT_EQ(behind.copies.size(), own.copies.size());
  for (size_t k = 0; k < own.copies.size(); ++k) {
    EXPECT_EQ(behind.copies[k].from, own.copies[k].from + 50);
    EXPECT_EQ(behind.copies[k].to, own.copies[k].to + 50);
  }
  EXPECT_EQ(behind.copied[0].index, own.copied[0].index + 50);
}

class SplatRefinement : public testing::FitField {
 protected:
  static constexpr float kFace = 0.1f;  // x: beyond it splats are held

  void SetUp() override {
    FitField::SetUp();
    fit_.steps = 150;
    fit_.thousands = 1;
    fit_.sh_degree = 1;
    box_.background = truth_.background;
    photos_of_ball_ = SplatPhotos(views_);
    const Splats coarse = FitSplats(views_, box_, fit_, {}).splats;
    // Those that stay first.
    Splats start(coarse.count(), coarse.basis);
    start.background = coarse.background;
    int64_t to = 0;
    for (const bool held : {false, true}) {
      for (int64_t i = 0; i < coarse.count(); ++i) {
        if ((coarse.mean[static_cast<size_t>(3 * i)] >= kFace) != held) continue;
        start.Set(to, coarse.view()[i]);
        std::copy_n(coarse.view().Coefficients(i), 3 * coarse.basis,
                    start.sh.begin() + 3 * coarse.basis * to);
        ++to;
      }
      if (!held) frozen_ = to;
    }
    start_ = RefinementOf(start, frozen_);
    fit_.thousands = 2;
    fit_.steps = 200;
    hold_.low.x = kFace;
  }

  SplatFitResult Refine(SplatFitHooks hooks, SplatFitState state) const {
    hooks.resume = &state;
    return RefineSplats(photos_of_ball_, hold_, box_, fit_, hooks);
  }

  SplatFitOptions fit_;
  SplatPhotos photos_of_ball_;
  SplatFitState start_;
  SplatHold hold_;
  int64_t frozen_ = 0;
};

TEST_F(SplatRefinement, FrozenSplatsKeepTheirBitsAndTheOthersTheirPlace) {
  ASSERT_GT(frozen_, 100);
  ASSERT_GT(start_.splats.count() - frozen_, 100);
  double before = 0, after = 0;
  const auto engine = MakeCpuSplatEngine({});
  engine->SetState(start_);
  before = DecibelsBetween(engine->Render(cameras_[0]).color, photos_[0]);
  SplatFitHooks hooks;
  hooks.measure = [&](SplatEngine* fitted) {
    after = DecibelsBetween(fitted->Render(cameras_[0]).color, photos_[0]);
  };
  const Splats refined = Refine(hooks, start_).splats;
  EXPECT_GT(after, before + 0.5);
  EXPECT_EQ(refined.count() - frozen_, 2000);  // without those that stay
  const auto same = [this](const std::vector<float>& a, const std::vector<float>& b,
                           int64_t each) {
    return std::equal(a.begin(), a.begin() + each * frozen_, b.begin());
  };
  EXPECT_TRUE(same(refined.mean, start_.splats.mean, 3));
  EXPECT_TRUE(same(refined.log_scale, start_.splats.log_scale, 3));
  EXPECT_TRUE(same(refined.quaternion, start_.splats.quaternion, 4));
  EXPECT_TRUE(same(refined.opacity_logit, start_.splats.opacity_logit, 1));
  EXPECT_EQ(refined.basis, start_.splats.basis);
  EXPECT_TRUE(same(refined.sh, start_.splats.sh, 3 * refined.basis));
  for (int64_t i = frozen_; i < refined.count(); ++i)
    ASSERT_GE(refined.mean[static_cast<size_t>(3 * i)], kFace) << i;
}

TEST_F(SplatRefinement, AResumedOneIsTheUndisturbedOne) {
  const Splats straight = Refine({}, start_).splats;
  SplatFitState saved;
  int done = 0;
  SplatFitHooks stop;
  stop.checkpoint = [&](const SplatFitState& state) { saved = state; };
  stop.progress = [&](const Progress&) {
    return ++done == 77 ? LoopControl::kStop : LoopControl::kContinue;
  };
  EXPECT_THROW(Refine(stop, start_), Interrupted);
  EXPECT_EQ(saved.frozen, frozen_);
  const Splats resumed = Refine({}, saved).splats;
  EXPECT_EQ(resumed.mean, straight.mean);
  EXPECT_EQ(resumed.sh, straight.sh);
  EXPECT_EQ(resumed.opacity_logit, straight.opacity_logit);
}

// It takes the rest of the steps, from moments of 0: without rising rates it loses 0.9 dB.
TEST_F(SplatRefinement, ALastTurnBeginsGently) {
  SplatFitState refined;
  SplatFitHooks keep;
  double before = 0, after = 0;
  keep.measure = [&](SplatEngine* fitted) {
    before = DecibelsBetween(fitted->Render(cameras_[0]).color, photos_[0]);
    fitted->ReadState([&](SplatFitState* state) { refined = RefinementOf(state->splats, 0); });
  };
  const SplatFitResult whole = Refine(keep, start_);
  refined.frozen = frozen_;
  fit_.begin = 0.75f;
  SplatFitHooks measure;
  measure.measure = [&](SplatEngine* fitted) {
    after = DecibelsBetween(fitted->Render(cameras_[0]).color, photos_[0]);
  };
  const SplatFitResult last = Refine(measure, refined);
  EXPECT_EQ(4 * last.pixels, whole.pixels);
  EXPECT_GT(after, before - 0.5);
}

}  // namespace
}  // namespace regrade
