#include "reconstruct/splats/fit_splats.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <optional>
#include <string>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/splats/splat_field.h"
#include "reconstruct/splats/initial_splats.h"
#include "reconstruct/splats/population.h"
#include "reconstruct/splats/splat_engine.h"

namespace regrade {
namespace {

double Psnr(double error, int64_t values) {
  return -10 * std::log10(error / static_cast<double>(std::max<int64_t>(values, 1)));
}

class SplatFitter {
 public:
  // `views`: what the photos were made of, where they begin at half their size.
  SplatFitter(const SplatPhotos& photos, const std::vector<TrainingView>* views,
              const SplatHold& hold, const SceneBox& box, const SplatFitOptions& options,
              const SplatFitHooks& hooks, Backend backend)
      : photos_(photos),
        views_(views),
        hold_(hold),
        box_(box),
        options_(options),
        hooks_(hooks) {
    const SplatOptions render = SplatOptionsFor(box.near_clip, box.radius, -1);
    engine_ =
        backend == Backend::kCuda ? MakeCudaSplatEngine(render) : MakeCpuSplatEngine(render);
    const CameraSpread cameras = SpreadOf(photos_, box);
    middle_ = cameras.middle.Cast<float>();
    extent_ = static_cast<float>(cameras.extent);
    most_ = static_cast<int64_t>(options.thousands * 1000);
    // On three captures of few photos, 1500 steps gained 0.8 dB and 0.02 of SSIM by this.
    const float fewer =
        std::clamp(kUsualSteps / static_cast<float>(options.steps), 1.0f, 10.0f);
    const float faster = std::pow(fewer, 0.3f);
    options_.rate_mean *= faster;
    options_.rate_mean_end *= fewer;
    options_.rate_scale *= faster;
    options_.rate_color *= faster;
    options_.growth *= faster;
  }

  SplatFitResult Run() {
    SplatFitState state;
    if (hooks_.resume != nullptr) {
      state = std::move(*hooks_.resume);
    } else {
      state.splats = InitialSplats(*views_, photos_, box_, options_);
      state.splats.background = box_.background.value_or(photos_.mean_color());
      state.first_moment = Splats(state.splats.count(), 1);
      state.second_moment = state.first_moment;
    }
    first_step_ = At(options_.begin);
    step_ = std::max(state.step, first_step_);
    frozen_ = state.frozen;
    if (state.tally.pixels == 0) state.spare_unseen = ShareInPicture(state.splats) < kFewSeen;
    spare_unseen_ = state.spare_unseen;
    tally_ = std::move(state.tally);
    engine_->SetState(std::move(state));
    start_ = last_checkpoint_ = ClockSeconds();
    ChoosePhotos();
    while (step_ < options_.steps) {
      Step();
      if (Report(hooks_.progress, step_, options_.steps, note_) == LoopControl::kStop) {
        SaveCheckpoint();
        throw Interrupted();
      }
      if (ClockSeconds() - last_checkpoint_ > kCheckpointSeconds) SaveCheckpoint();
    }
    CloseWindow();
    SplatFitResult result;
    result.seconds = ClockSeconds() - start_ - idle_;
    Measure();
    engine_->ReadState([&](SplatFitState* end) { result.splats = end->splats; });
    result.fit_pixel = photos_.pixel();
    result.psnr_train_db = Psnr(tally_.tail_error, tally_.tail_values);
    result.pixels = tally_.pixels;
    result.rejected = tally_.rejected;
    result.entries_per_step = static_cast<double>(tally_.entries) / std::max(1, options_.steps);
    result.curve = std::move(tally_.curve);
    return result;
  }

 private:
  // Of the splats that change, the share that lies within a photo, on average.
  double ShareInPicture(const Splats& splats) const {
    double inside = 0;
    for (int v = 0; v < photos_.count(); ++v) {
      const Camera& camera = photos_[v].camera;
      for (int64_t i = frozen_; i < splats.count(); ++i) {
        const Vec3f mean = splats.view()[i].mean;
        double x, y;
        inside += camera.Project(mean.Cast<double>(), &x, &y) && x >= 0 && y >= 0 &&
                  x < camera.width && y < camera.height;
      }
    }
    return inside / (static_cast<double>(photos_.count()) *
                     static_cast<double>(std::max<int64_t>(1, splats.count() - frozen_)));
  }

  float Steps() const { return static_cast<float>(options_.steps); }
  int64_t count() const { return engine_->count() - frozen_; }  // that change
  int At(float part) const { return static_cast<int>(std::lround(part * Steps())); }
  bool is_long() const { return options_.steps >= options_.long_from; }

  // Half the photos' size at first.
  void ChoosePhotos() {
    const bool small = views_ != nullptr && step_ < At(options_.small_until);
    if (small && !small_) small_.emplace(*views_, 2);
    if (!small) small_.reset();
    engine_->SetPhotos(small ? &*small_ : &photos_);
  }

  // Each photo once in a round, in an order of its own.
  int PhotoOfStep() {
    const int n = photos_.count(), round = step_ / n;
    if (round != round_) {
      round_ = round;
      order_.resize(static_cast<size_t>(n));
      std::iota(order_.begin(), order_.end(), 0);
      for (int k = n - 1; k > 0; --k)
        std::swap(
            order_[static_cast<size_t>(k)],
            order_[RandomIndex(options_.seed ^ kRandomSplatViews, static_cast<uint64_t>(round),
                               static_cast<uint64_t>(k), static_cast<uint64_t>(k) + 1)]);
    }
    return order_[static_cast<size_t>(step_ % n)];
  }

  void Step() {
    if (step_ == At(options_.small_until) && step_ > 0) ChoosePhotos();
    Populate();
    const int degree =
        std::min(options_.sh_degree, step_ / std::max(1, At(options_.degree_each)));
    if (BasisOfDegree(degree) > engine_->basis()) engine_->SetBasis(BasisOfDegree(degree));
    SplatStep step;
    step.photo = PhotoOfStep();
    step.ssim_weight = options_.ssim_weight;
    SplatUpdate& update = step.update;
    const float part = static_cast<float>(step_) / Steps();
    step.depth_weight =
        options_.depth_weight * std::pow(is_long() ? kLongDepthFall : kDepthFall, part);
    const float warm = WarmUp();
    const float rate = warm * options_.rate_mean *
                       std::pow(options_.rate_mean_end / options_.rate_mean, part) * extent_;
    const float fall =  // of rates
        warm * (is_long() ? std::pow(options_.fall, std::max(0.0f, 2 * part - 1)) : 1.0f);
    update.rates = {rate,
                    options_.rate_scale * fall,
                    options_.rate_quaternion * fall,
                    options_.rate_opacity * fall,
                    options_.rate_color * fall,
                    options_.rate_view * fall,
                    middle_,
                    extent_};
    update.noise = options_.noise * rate;
    update.frozen = frozen_;
    update.hold = hold_;
    update.spare_unseen = spare_unseen_;
    if (is_long())
      step.dropout =
          SplatDropout(options_.dropout * part, options_.seed, static_cast<uint64_t>(step_));
    const float splats = static_cast<float>(count());
    const float weights =
        is_long() && photos_.count() < options_.few_photos ? options_.few_photos_weights : 1.0f;
    update.opacity_weight = weights * options_.opacity_weight / splats;
    update.scale_weight = weights * options_.scale_weight / (3 * splats);
    update.seed = options_.seed;
    update.SetStep(static_cast<uint64_t>(step_), static_cast<uint64_t>(first_step_));
    engine_->Step(step);
    ++step_;
    if (step_ % kWindow == 0) CloseWindow();
  }

  // Adam's first steps are of full size in every direction: in a refinement that leaves most of
  // its steps out, rates rise during the first quarter of those that are left.
  float WarmUp() const {
    const float rise = 0.25f * static_cast<float>(options_.steps - first_step_);
    return first_step_ == 0
               ? 1.0f
               : std::min(1.0f, static_cast<float>(step_ - first_step_ + 1) / rise);
  }

  int StepsBetweenChanges() const {
    const int each = std::max(1, At(options_.grow_each));
    if (!is_long()) return each;
    const int seen =
        static_cast<int>(options_.grow_rounds * static_cast<float>(photos_.count()));
    return std::max(each, std::min(seen, At(options_.grow_each_most)));
  }

  // Moves dead splats and adds new ones.
  void Populate() {
    const int each = StepsBetweenChanges();
    if (step_ % each != 0 || step_ < At(options_.grow_from) || step_ == 0 ||
        step_ >= At(options_.grow_until))
      return;
    const uint64_t number = static_cast<uint64_t>(step_);
    std::vector<float> logits = engine_->OpacityLogits();
    logits.erase(logits.begin(), logits.begin() + frozen_);
    const PopulationChange moved = MoveDead(logits, options_.seed, number);
    if (!moved.copies.empty()) engine_->Change(Behind(frozen_, moved));
    const int64_t now = count();
    const float growth =
        std::pow(1 + options_.growth,
                 static_cast<float>(each) / std::max(1.0f, options_.grow_each * Steps()));
    const int64_t more = std::min(most_, static_cast<int64_t>(std::min(growth, 2.0f) *
                                                              static_cast<float>(now))) -
                         now;
    if (more <= 0) return;
    for (const CopiedSplat& copied : moved.copied)
      logits[static_cast<size_t>(copied.index)] = copied.opacity_logit;
    for (const SplatCopy& copy : moved.copies)
      logits[static_cast<size_t>(copy.to)] = logits[static_cast<size_t>(copy.from)];
    engine_->Change(Behind(frozen_, Grow(logits, more, options_.seed, number)));
  }

  void CloseWindow() {
    TakeSums();
    if (tally_.window_values == 0) return;
    if (step_ > options_.steps - options_.steps / 10) {
      tally_.tail_error += tally_.window_error;
      tally_.tail_values += tally_.window_values;
    }
    const double psnr = Psnr(tally_.window_error, tally_.window_values);
    tally_.curve.push_back({step_, ClockSeconds() - start_ - idle_, psnr, count()});
    char text[96];
    std::snprintf(text, sizeof text, "%.0f k splats, %.2f dB on training photos",
                  static_cast<double>(count()) * 1e-3, psnr);
    note_ = text;
    tally_.window_error = 0;
    tally_.window_values = 0;
  }

  void TakeSums() {
    const SplatFitSums sums = engine_->TakeSums();
    tally_.window_error += sums.picture.squared;
    tally_.window_values += sums.picture.values;
    tally_.pixels += sums.picture.values / 3;
    tally_.entries += sums.entries;
    tally_.rejected += sums.rejected;
  }

  void SaveCheckpoint() {
    const double begin = ClockSeconds();
    if (hooks_.checkpoint) {
      TakeSums();
      engine_->ReadState([this](SplatFitState* state) {
        state->step = step_;
        state->frozen = frozen_;
        state->spare_unseen = spare_unseen_;
        state->tally = tally_;
        hooks_.checkpoint(*state);
      });
    }
    last_checkpoint_ = ClockSeconds();
    idle_ += last_checkpoint_ - begin;
  }

  void Measure() {
    const double begin = ClockSeconds();
    if (hooks_.measure) hooks_.measure(engine_.get());
    idle_ += ClockSeconds() - begin;
  }

  static constexpr float kUsualSteps = 15000;  // fits of fewer take larger ones
  static constexpr int kWindow = 50;           // steps
  // Where a photo sees less of the splats, those that none has changed are spared the
  // regularizers: streets and tours, 0.07 to 0.14; a room has 0.23, and would lose 0.3 dB.
  static constexpr double kFewSeen = 1.0 / 6;
  // Of the weight of depths, over a fit.
  static constexpr float kDepthFall = 0.01f, kLongDepthFall = 1e-6f;
  static constexpr double kCheckpointSeconds = 60;

  const SplatPhotos& photos_;
  const std::vector<TrainingView>* views_;
  SplatHold hold_;
  SceneBox box_;
  SplatFitOptions options_;
  SplatFitHooks hooks_;
  std::optional<SplatPhotos> small_;
  std::unique_ptr<SplatEngine> engine_;
  Vec3f middle_;  // of the cameras
  float extent_ = 1;
  int64_t most_ = 0, frozen_ = 0;
  bool spare_unseen_ = false;
  int first_step_ = 0, step_ = 0, round_ = -1;
  std::vector<int> order_;
  SplatFitTally tally_;
  double start_ = 0, last_checkpoint_ = 0, idle_ = 0;
  std::string note_;
};

}  // namespace

SplatFitResult FitSplats(const std::vector<TrainingView>& views, const SceneBox& box,
                         const SplatFitOptions& options, const SplatFitHooks& hooks,
                         Backend backend) {
  const SplatPhotos photos(views);
  return SplatFitter(photos, &views, {}, box, options, hooks, backend).Run();
}

SplatFitState RefinementOf(Splats splats, int64_t frozen) {
  SplatFitState state;
  state.first_moment = Splats(splats.count(), splats.basis);
  state.second_moment = state.first_moment;
  state.splats = std::move(splats);
  state.frozen = frozen;
  return state;
}

SplatFitResult RefineSplats(const SplatPhotos& photos, const SplatHold& hold,
                            const SceneBox& box, const SplatFitOptions& options,
                            const SplatFitHooks& hooks, Backend backend) {
  REGRADE_CHECK(hooks.resume != nullptr);
  return SplatFitter(photos, nullptr, hold, box, options, hooks, backend).Run();
}

}  // namespace regrade
