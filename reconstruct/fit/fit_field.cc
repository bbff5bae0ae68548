#include "reconstruct/fit/fit_field.h"

#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "reconstruct/fit/adapt_options.h"
#include "reconstruct/fit/fit_engine.h"
#include "reconstruct/fit/resample_grid.h"
#include "reconstruct/fit/sphere_grid.h"

namespace regrade {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double PsnrOf(double squared_error, int64_t rays) {
  return -10 *
         std::log10(squared_error / (3.0 * static_cast<double>(std::max<int64_t>(rays, 1))));
}

FitConditions ConditionsOf(const std::vector<TrainingView>& views, Backend backend) {
  FitConditions conditions;
  conditions.on_card = backend == Backend::kCuda;
  for (const TrainingView& view : views)
    conditions.pixels += int64_t{view.camera.width} * view.camera.height;
  return conditions;
}

class Fitter {
 public:
  Fitter(const std::vector<TrainingView>& views, const SceneBox& box, const FitOptions& options,
         const FitHooks& hooks, Backend backend)
      : rays_(views),
        box_(box),
        options_(AdaptOptions(options, ConditionsOf(views, backend))),
        hooks_(hooks),
        sums_each_step_(backend == Backend::kCpu) {
    REGRADE_CHECK_EQ(options_.resolutions.size(), options_.steps.size());
    for (size_t s = 0; s < options_.steps.size(); ++s) {
      total_steps_ += options_.steps[s];
      total_work_ += options_.steps[s] * WorkOfStep(static_cast<int>(s));
    }
    if (backend == Backend::kCuda)
      engine_ = MakeCudaFitEngine(&rays_, options.seed, options.exact_sums);
    else
      engine_ = MakeCpuFitEngine(&rays_, options.seed,
                                 options.shards > 0 ? options.shards : omp_get_max_threads());
  }

  FitResult Run() {
    FitState state;
    if (hooks_.resume != nullptr) {
      state = std::move(*hooks_.resume);
    } else {
      state.grid = InitialGrid();
      if (box_.background) state.grid.background = *box_.background;
      if (state.grid.num_voxels() == 0 ||
          (options_.initial_views < 2 && rays_.num_views() > 1 &&
           !TwoViewsShareAPlace(rays_, state.grid.frame, box_.near_clip)))
        throw SceneError(
            Concat("no place is seen by ",
                   options_.initial_views <= 2 ? "two" : std::to_string(options_.initial_views),
                   " of the ", rays_.num_views(),
                   " photos that are fitted: wrong poses, or too few"),
            "reconstruct",
            "check the poses against the photos, or give more photos that "
            "overlap by two thirds");
      if (box_.far_surroundings) {
        state.grid.spheres = MakeInitialSpheres(
            rays_, state.grid.frame, options_.background_layers, SphereResolution(0),
            options_.initial_background_density, state.grid.background);
        // The background is fitted first, because the box would model distant surfaces wrongly.
        if (LeadSteps() > 0) SetDensities(0, &state.grid);
      }
    }
    stage_ = state.stage;
    step_ = state.step;
    tally_ = std::move(state.tally);
    engine_->SetState(std::move(state));
    start_ = last_checkpoint_ = Clock::now();
    const int num_stages = static_cast<int>(options_.steps.size());
    while (stage_ < num_stages) {
      RunStage();
      if (++stage_ == num_stages) break;
      Refine(false);
      step_ = 0;
      SaveCheckpoint();
    }
    engine_->EndSteps();
    // Prunes once more without resampling: removes voxels that no training view sees.
    if (options_.prune_last) Refine(true);
    result_.seconds = SecondsSince(start_) - idle_seconds_;
    result_.voxels = engine_->num_voxels();
    engine_->ReadState(
        [this](FitState* state) { result_.field = ToRadianceField(state->grid); });
    result_.field.march = MarchOfField(options_);
    result_.psnr_train_db = PsnrOf(tally_.tail_error, tally_.tail_rays);
    result_.rays = tally_.rays;
    result_.samples = tally_.samples;
    result_.rejected_voxels = tally_.rejected_voxels;
    result_.curve = std::move(tally_.curve);
    return std::move(result_);
  }

 private:
  static void SetDensities(float density, FastGrid* grid) {
    for (int64_t v = 0; v < grid->num_voxels(); ++v)
      grid->records[v * grid->lanes() + DensityLane(grid->basis)] = density;
    RefreshDerived(grid);
  }

  FastGrid InitialGrid() const {
    const GridFrame frame{GridOfStage(options_, box_, 0), box_.center, box_.radius};
    return MakeInitialGrid(rays_, frame, BasisOfDegree(options_.sh_degree),
                           options_.initial_density, box_.near_clip, options_.initial_views,
                           options_.ball || box_.far_surroundings);
  }

  int StepsBefore() const {
    int steps = step_;
    for (int s = 0; s < stage_; ++s) steps += options_.steps[static_cast<size_t>(s)];
    return steps;
  }

  // The time of a step grows with its samples per ray, thus with the resolution. Progress in
  // this unit predicts the remaining time well in the coarse stages, too.
  double WorkBefore() const {
    double work = static_cast<double>(step_) * WorkOfStep(stage_);
    for (int s = 0; s < stage_; ++s)
      work += options_.steps[static_cast<size_t>(s)] * WorkOfStep(s);
    return work;
  }
  double WorkOfStep(int stage) const {
    return options_.resolutions[static_cast<size_t>(stage)];
  }

  void RunStage() {
    const int steps = options_.steps[static_cast<size_t>(stage_)];
    while (step_ < steps) {
      if (box_.far_surroundings && LeadSteps() > 0 && StepsBefore() == LeadSteps())
        engine_->EditState(
            [this](FitState* state) { SetDensities(options_.initial_density, &state->grid); });
      engine_->Step(NextStep());
      ++step_;
      if (sums_each_step_) TakeSums();
      const int square = options_.patch * options_.patch;
      tally_.window_rays += std::max(1, options_.rays_per_step / square) * square;
      if (StepsBefore() % kWindow == 0 || step_ == steps) CloseWindow();
      const LoopControl control = Report(hooks_.progress, WorkBefore(), total_work_, note_);
      if (control == LoopControl::kStop) {
        SaveCheckpoint();
        throw Interrupted();
      }
      if (SecondsSince(last_checkpoint_) > 60) SaveCheckpoint();
    }
  }

  FitStep NextStep() const {
    FitStep step;
    const int number = StepsBefore();
    const double p = static_cast<double>(number) /
                     (options_.rate_steps > 0 ? options_.rate_steps : total_steps_);
    const float decay = std::pow(options_.tv_decay, static_cast<float>(stage_));
    step.number = static_cast<uint64_t>(number);
    step.rays = options_.rays_per_step;
    step.patch = options_.patch;
    step.march = {options_.step, options_.stop_transmittance};
    step.optimizer.rate_sh = ExponentialRate(options_.rate_sh, options_.rate_sh_end, p);
    step.optimizer.rate_density =
        ExponentialRate(options_.rate_density, options_.rate_density_end, p) *
        DelayFactor(number, options_.density_delay * static_cast<float>(total_steps_));
    step.optimizer.view_bound = options_.view_bound;
    if (!options_.bound_mean) step.optimizer.mean_bound = kUnbounded;
    step.losses = {options_.beta_loss, options_.sparsity_loss};
    step.tv_fraction = options_.tv_fraction;
    step.tv_density = decay * options_.tv_density;
    step.tv_sh = decay * options_.tv_sh;
    if (!box_.far_surroundings) return step;
    step.optimizer.rate_sphere_density = ExponentialRate(
        options_.rate_background_density, options_.rate_background_density_end, p);
    step.optimizer.rate_sphere_color =
        ExponentialRate(options_.rate_background_color, options_.rate_background_color_end, p);
    step.tv_sphere_fraction = options_.tv_background_fraction;
    const float sphere_decay = options_.tv_background_decays ? decay : 1.0f;
    step.tv_sphere_density = sphere_decay * options_.tv_background_density;
    step.tv_sphere_color = sphere_decay * options_.tv_background_color;
    return step;
  }

  int LeadSteps() const {
    return static_cast<int>(options_.background_lead * static_cast<float>(options_.steps[0]));
  }

  int SphereResolution(int stage) const {
    if (!options_.background_grows) return options_.background_resolution;
    return SphereResolutionFor(options_.background_resolution,
                               options_.resolutions[static_cast<size_t>(stage)],
                               options_.resolutions.back());
  }

  // Prunes, and resamples to the grid of stage_; `last` keeps the resolution.
  void Refine(bool last) {
    const int last_stage = static_cast<int>(options_.resolutions.size()) - 1;
    const int sphere_resolution = SphereResolution(std::min(stage_, last_stage));
    const Vec3i now = engine_->resolution();
    const Vec3i next = last ? now : GridOfStage(options_, box_, static_cast<size_t>(stage_));
    const bool by_density = options_.prune_by == "density";
    const int side = by_density                              ? 1
                     : options_.prune_by == "weight-of-next" ? next.z
                                                             : std::max({now.x, now.y, now.z});
    engine_->Refine({options_.step, options_.stop_transmittance},
                    {by_density, options_.prune_weight / static_cast<float>(side),
                     MostVoxelsBefore(now, next)},
                    next, sphere_resolution);
  }

  // How many vertices may stay on a grid of `now` so that fit-max-voxels are left on `next`,
  // whose vertices are closer; 0: any number.
  int64_t MostVoxelsBefore(const Vec3i& now, const Vec3i& next) const {
    if (options_.max_voxels == 0) return 0;
    const auto vertices = [](const Vec3i& n) { return double(n.x) * n.y * n.z; };
    return std::max<int64_t>(1, static_cast<int64_t>(double{options_.max_voxels} * 1e6 *
                                                     vertices(now) / vertices(next)));
  }

  // A device's sums are read once per window, so that it need not wait for the host at each
  // step. The CPU's are read at each step, so that a resumed fit adds them in the same order.
  void CloseWindow() {
    TakeSums();
    const int done = StepsBefore();
    tally_.rays += tally_.window_rays;
    if (done > total_steps_ - total_steps_ / 10 - 1) {
      tally_.tail_error += tally_.window_error;
      tally_.tail_rays += tally_.window_rays;
    }
    const double psnr = PsnrOf(tally_.window_error, tally_.window_rays);
    tally_.curve.push_back({tally_.rays, SecondsSince(start_) - idle_seconds_, psnr, done});
    char text[96];
    std::snprintf(text, sizeof text, "%d^3, %.2f M voxels, %.2f dB on training rays",
                  options_.resolutions[static_cast<size_t>(stage_)],
                  static_cast<double>(engine_->num_voxels()) * 1e-6, psnr);
    note_ = text;
    tally_.window_rays = 0;
    tally_.window_error = 0;
  }

  void TakeSums() {
    const FitSums sums = engine_->TakeSums();
    tally_.window_error += sums.squared_error;
    tally_.samples += sums.samples;
    tally_.rejected_voxels += sums.rejected_voxels;
    // A few non-finite gradients are skipped and counted; many mean that the field is broken.
    if (sums.rejected_voxels > 1000)
      throw Error(ExitCode::kBug,
                  "the gradient of " + std::to_string(sums.rejected_voxels) +
                      " voxels is not finite at step " + std::to_string(StepsBefore()),
                  "reconstruct", "the last checkpoint has been kept");
  }

  void SaveCheckpoint() {
    const Clock::time_point begin = Clock::now();
    if (hooks_.checkpoint) {
      TakeSums();  // a resumed fit continues the window
      engine_->ReadState([this](FitState* state) {
        state->stage = stage_;
        state->step = step_;
        state->tally = tally_;
        hooks_.checkpoint(*state);
      });
    }
    idle_seconds_ += SecondsSince(begin);
    last_checkpoint_ = Clock::now();
  }

  static constexpr int kWindow = 20;  // steps

  TrainingRays rays_;
  SceneBox box_;
  FitOptions options_;
  FitHooks hooks_;
  const bool sums_each_step_;
  std::unique_ptr<FitEngine> engine_;
  FitResult result_;
  int stage_ = 0, step_ = 0;  // step within the stage
  int total_steps_ = 0;
  double total_work_ = 0;
  FitTally tally_;
  double idle_seconds_ = 0;
  std::string note_;
  Clock::time_point start_, last_checkpoint_;
};

}  // namespace

float ExponentialRate(float begin, float end, double p) {
  if (begin <= 0 || end <= 0) return 0;
  return static_cast<float>(
      begin * std::pow(static_cast<double>(end) / begin, std::clamp(p, 0.0, 1.0)));
}

// As in svox2, which starts at a hundredth.
float DelayFactor(int step, float delay) {
  if (static_cast<float>(step) >= delay) return 1;
  constexpr float kLeast = 0.01f, kQuarterTurn = 1.57079633f;
  return kLeast + (1 - kLeast) * std::sin(kQuarterTurn * static_cast<float>(step) / delay);
}

FitResult FitField(const std::vector<TrainingView>& views, const SceneBox& box,
                   const FitOptions& options, const FitHooks& hooks, Backend backend) {
  return Fitter(views, box, options, hooks, backend).Run();
}

}  // namespace regrade
