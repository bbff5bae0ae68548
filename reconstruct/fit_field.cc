#include "reconstruct/fit_field.h"

#include <omp.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "reconstruct/resample_grid.h"

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

class Fitter {
 public:
  Fitter(const std::vector<TrainingView>& views, const SceneBox& box, const FitOptions& options,
         const FitHooks& hooks)
      : rays_(views), box_(box), options_(options), hooks_(hooks) {
    REGRADE_CHECK_EQ(options.resolutions.size(), options.steps.size());
    for (size_t s = 0; s < options.steps.size(); ++s) {
      total_steps_ += options.steps[s];
      total_work_ += options.steps[s] * WorkOfStep(static_cast<int>(s));
    }
    arenas_.resize(
        static_cast<size_t>(options.shards > 0 ? options.shards : omp_get_max_threads()));
  }

  FitResult Run() {
    if (hooks_.resume != nullptr) {
      state_ = *hooks_.resume;
    } else {
      const GridFrame frame{ResolutionFor(box_.radius, options_.resolutions[0]), box_.center,
                            box_.radius};
      state_.grid = MakeInitialGrid(rays_, frame, BasisOf(options_.sh_degree),
                                    options_.initial_density, box_.near_clip, 2);
      if (state_.grid.num_voxels() == 0)
        throw Error(ExitCode::kScene, "no part of the scene's box is seen by two cameras",
                    "reconstruct",
                    "the poses do not fit together; photograph with more overlap");
      state_.second_moment.Resize(state_.grid.records.size());
    }
    start_ = last_checkpoint_ = Clock::now();
    const int num_stages = static_cast<int>(options_.steps.size());
    while (state_.stage < num_stages) {
      RunStage();
      if (finish_early_ || ++state_.stage == num_stages) break;
      Refine(options_.resolutions[static_cast<size_t>(state_.stage)]);
      state_.step = 0;
      SaveCheckpoint();
    }
    // A last pruning without growth: what no training view sees does not belong into the
    // result.
    Refine(0);
    result_.field = ToRadianceField(state_.grid);
    result_.field.step = options_.step;
    result_.seconds = SecondsSince(start_) - checkpoint_seconds_;
    result_.psnr_train_db = PsnrOf(tail_error_, tail_rays_);
    return std::move(result_);
  }

 private:
  static int BasisOf(int degree) { return (degree + 1) * (degree + 1); }

  int StepsBefore() const {
    int steps = state_.step;
    for (int s = 0; s < state_.stage; ++s) steps += options_.steps[static_cast<size_t>(s)];
    return steps;
  }

  // A step costs what its samples cost, and a ray's samples grow with the resolution: progress
  // in that unit makes the time left come out right while the stages are still coarse.
  double WorkBefore() const {
    double work = static_cast<double>(state_.step) * WorkOfStep(state_.stage);
    for (int s = 0; s < state_.stage; ++s)
      work += options_.steps[static_cast<size_t>(s)] * WorkOfStep(s);
    return work;
  }
  double WorkOfStep(int stage) const {
    return options_.resolutions[static_cast<size_t>(stage)];
  }

  void RunStage() {
    for (auto& arena : arenas_) arena.Reset(state_.grid.num_voxels(), state_.grid.lanes());
    const int steps = options_.steps[static_cast<size_t>(state_.stage)];
    while (state_.step < steps) {
      Step();
      ++state_.step;
      const Verdict verdict = ReportProgress();
      if (verdict == Verdict::kAbort) {
        SaveCheckpoint();
        throw Interrupted();
      }
      if (verdict == Verdict::kFinish) {
        finish_early_ = true;
        return;
      }
      if (SecondsSince(last_checkpoint_) > 60) SaveCheckpoint();
    }
  }

  void Step() {
    const int global_step = StepsBefore();
    const double p = static_cast<double>(global_step) / total_steps_;
    const int patch = options_.patch;
    const int patches = std::max(1, options_.rays_per_step / (patch * patch));
    rays_.Draw(options_.seed, static_cast<uint64_t>(global_step), patches, patch, &batch_rays_,
               &batch_targets_);
    const int64_t n = static_cast<int64_t>(batch_rays_.size());
    const float scale = 1.0f / (3.0f * static_cast<float>(n));
    const MarchOptions march{options_.step, options_.stop_transmittance};
    const int shards = static_cast<int>(arenas_.size());
    std::vector<FitStepResult> results(arenas_.size());

    // A contiguous run of vertices is regularised, from a random start, wrapping around.
    const int64_t vertices = state_.grid.frame.NumVertices();
    const int64_t run = static_cast<int64_t>(options_.tv_share * static_cast<float>(vertices));
    const int64_t run_begin = static_cast<int64_t>(
        RandomIndex(options_.seed ^ 0x7476ull, static_cast<uint64_t>(global_step), 0,
                    static_cast<uint64_t>(vertices)));
    const float decay = std::pow(options_.tv_decay, static_cast<float>(state_.stage));
    // Of the run alone, scaled so that its expectation is lambda times the mean over all
    // voxels.
    const float tv_scale = run > 0 ? decay / static_cast<float>(run) : 0.0f;

#pragma omp parallel for schedule(dynamic, 1)
    for (int s = 0; s < shards; ++s) {
      const int64_t begin = n * s / shards, end = n * (s + 1) / shards;
      const RayBatch batch{&batch_rays_[static_cast<size_t>(begin)],
                           &batch_targets_[static_cast<size_t>(begin)], end - begin};
      GradientArena* arena = &arenas_[static_cast<size_t>(s)];
      results[static_cast<size_t>(s)] =
          FastRays().accumulate(state_.grid, batch, march, scale, arena);
      for (int64_t v = run * s / shards; v < run * (s + 1) / shards;) {
        const int64_t from = (run_begin + v) % vertices;
        const int64_t count = std::min(run * (s + 1) / shards - v, vertices - from);
        FastRays().total_variation(state_.grid, from, from + count,
                                   options_.tv_density * tv_scale, options_.tv_sh * tv_scale,
                                   arena);
        v += count;
      }
    }

    RmspropOptions optimizer;
    optimizer.rate_sh = ExponentialRate(options_.rate_sh, options_.rate_sh_end, p);
    optimizer.rate_density =
        ExponentialRate(options_.rate_density, options_.rate_density_end, p);
    optimizer.view_bound = options_.view_bound;
    constexpr int64_t kChunk = 2048;
    std::vector<std::pair<int, int64_t>> chunks;
    for (int s = 0; s < shards; ++s)
      for (int64_t b = 0; b < arenas_[static_cast<size_t>(s)].voxel_of_slot.size(); b += kChunk)
        chunks.push_back({s, b});
    int64_t rejected = 0;
#pragma omp parallel for schedule(dynamic, 4) reduction(+ : rejected)
    for (size_t c = 0; c < chunks.size(); ++c) {
      const auto [s, begin] = chunks[c];
      const int64_t end =
          std::min(begin + kChunk, arenas_[static_cast<size_t>(s)].voxel_of_slot.size());
      rejected += FastRays().step(&state_.grid, state_.second_moment.data(), arenas_.data(),
                                  shards, s, begin, end, optimizer);
    }
#pragma omp parallel for schedule(dynamic, 1)
    for (int s = 0; s < shards; ++s) arenas_[static_cast<size_t>(s)].Forget();

    for (const FitStepResult& r : results) {
      window_error_ += r.squared_error;
      result_.samples += r.samples;
      if (global_step >= total_steps_ - total_steps_ / 10 - 1) tail_error_ += r.squared_error;
    }
    if (global_step >= total_steps_ - total_steps_ / 10 - 1) tail_rays_ += n;
    window_rays_ += n;
    result_.rays += n;
    result_.rejected_voxels += rejected;
    // A few bad voxels are skipped and counted; a flood means the field is broken.
    if (rejected > 1000)
      throw Error(ExitCode::kBug,
                  "the gradient of " + std::to_string(rejected) +
                      " voxels is not finite at step " + std::to_string(global_step),
                  "reconstruct", "the last checkpoint has been kept");
  }

  // Prunes by weight and goes on at `longest` voxels a side; 0 keeps the resolution.
  void Refine(int longest) {
    const MarchOptions march{options_.step, options_.stop_transmittance};
    const Buffer<float> weights = MaxWeightsOverViews(state_.grid, rays_, march, 2);
    const Vec3i n = state_.grid.frame.resolution;
    const float longest_now = static_cast<float>(std::max({n.x, n.y, n.z}));
    const Vec3i next = longest > 0 ? ResolutionFor(box_.radius, longest) : n;
    state_.grid = Resample(state_.grid, weights, options_.prune_weight / longest_now, next);
    // The optimizer's state is of the old voxels: it starts anew, as in svox2.
    state_.second_moment = Buffer<float>(state_.grid.records.size());
  }

  Verdict ReportProgress() {
    const int done = StepsBefore();
    if (done % 20 == 0 || done == total_steps_) {
      const double psnr = PsnrOf(window_error_, window_rays_);
      result_.curve.push_back({result_.rays, SecondsSince(start_), psnr});
      char text[96];
      std::snprintf(text, sizeof text, "%d^3, %.2f M voxels, %.2f dB on training rays",
                    options_.resolutions[static_cast<size_t>(state_.stage)],
                    static_cast<double>(state_.grid.num_voxels()) * 1e-6, psnr);
      note_ = text;
      window_error_ = 0;
      window_rays_ = 0;
    }
    return Report(hooks_.progress, WorkBefore(), total_work_, note_);
  }

  void SaveCheckpoint() {
    const Clock::time_point begin = Clock::now();
    if (hooks_.checkpoint) hooks_.checkpoint(state_);
    checkpoint_seconds_ += SecondsSince(begin);
    last_checkpoint_ = Clock::now();
  }

  TrainingRays rays_;
  SceneBox box_;
  FitOptions options_;
  FitHooks hooks_;
  FitState state_;
  FitResult result_;
  std::vector<GradientArena> arenas_;
  std::vector<Ray> batch_rays_;
  std::vector<Vec3f> batch_targets_;
  int total_steps_ = 0;
  double total_work_ = 0;
  bool finish_early_ = false;
  double window_error_ = 0, tail_error_ = 0, checkpoint_seconds_ = 0;
  int64_t window_rays_ = 0, tail_rays_ = 0;
  std::string note_;
  Clock::time_point start_, last_checkpoint_;
};

}  // namespace

float ExponentialRate(float begin, float end, double p) {
  if (begin <= 0 || end <= 0) return 0;
  return static_cast<float>(begin * std::pow(static_cast<double>(end) / begin, p));
}

FitResult FitField(const std::vector<TrainingView>& views, const SceneBox& box,
                   const FitOptions& options, const FitHooks& hooks) {
  return Fitter(views, box, options, hooks).Run();
}

}  // namespace regrade
