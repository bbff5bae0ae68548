// Fit steps on the CPU: gradients are accumulated in one arena per shard and added in a fixed
// order.
#include <omp.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/render_view.h"
#include "reconstruct/fit/fit_engine.h"
#include "reconstruct/fit/resample_grid.h"
#include "reconstruct/fit/sphere_grid.h"

namespace regrade {
namespace {

constexpr int64_t kChunk = 2048;   // slots per task
constexpr int kPruningStride = 2;  // every other row and column of a view

class CpuFitEngine : public FitEngine {
 public:
  CpuFitEngine(const TrainingRays* rays, uint64_t seed, int shards)
      : rays_(rays), seed_(seed), arenas_(static_cast<size_t>(shards)) {}

  void SetState(FitState state) override {
    state_ = std::move(state);
    if (state_.second_moment.size() != state_.grid.records.size())
      state_.second_moment = Buffer<float>(state_.grid.records.size());
    if (state_.sphere_moment.size() != state_.grid.spheres.texels.size())
      state_.sphere_moment = Buffer<float>(state_.grid.spheres.texels.size());
    ResetArenas();
  }
  void ReadState(const std::function<void(FitState*)>& read) override { read(&state_); }
  void EditState(const std::function<void(FitState*)>& edit) override { edit(&state_); }
  void EndSteps() override {
    arenas_.clear();
    state_.second_moment = {};
    state_.sphere_moment = {};
  }
  int64_t num_voxels() const override { return state_.grid.num_voxels(); }
  Vec3i resolution() const override { return state_.grid.frame.resolution; }

  void Step(const FitStep& step) override {
    const int patches = std::max(1, step.rays / (step.patch * step.patch));
    rays_->Draw(seed_, step.number, patches, step.patch, &batch_rays_, &batch_targets_);
    Accumulate(step);
    StepVoxels(step.optimizer);
    if (state_.grid.spheres.on()) StepLayers(step.optimizer);
#pragma omp parallel for schedule(dynamic, 1)
    for (GradientArena& arena : arenas_) arena.Forget();
  }

  RenderedView Render(const Camera& camera, const MarchOptions& march) override {
    return RenderView(state_.grid, camera, march);
  }

  FitSums TakeSums() override { return std::exchange(sums_, {}); }

  void Refine(const MarchOptions& march, const PruneLimits& limits, const Vec3i& resolution,
              int sphere_resolution) override {
    const Buffer<float> weights =
        limits.by_density ? Densities()
                          : MaxWeightsOverViews(state_.grid, *rays_, march, kPruningStride);
    const float threshold = BoundedLimit(weights, limits.least, limits.max_voxels);
    FastSpheres spheres = std::move(state_.grid.spheres);
    state_.grid = Resample(state_.grid, weights, threshold, resolution);
    if (spheres.on() && sphere_resolution != spheres.resolution)
      spheres = ResampleSpheres(spheres, sphere_resolution);
    state_.grid.spheres = std::move(spheres);
    state_.sphere_moment = Buffer<float>(state_.grid.spheres.texels.size());
    state_.second_moment = Buffer<float>(state_.grid.records.size());
    ResetArenas();
  }

 private:
  Buffer<float> Densities() const {
    Buffer<float> densities(state_.grid.num_voxels());
    for (int64_t v = 0; v < densities.size(); ++v)
      densities[v] =
          state_.grid.records[v * state_.grid.lanes() + DensityLane(state_.grid.basis)];
    return densities;
  }

  void ResetArenas() {
    for (GradientArena& arena : arenas_) {
      arena.Reset(state_.grid.num_voxels());
      arena.spheres.Reset(state_.grid.spheres.num_texels());
    }
  }

  void Accumulate(const FitStep& step) {
    const int64_t n = static_cast<int64_t>(batch_rays_.size());
    const float scale = 1.0f / (3.0f * static_cast<float>(n));
    const int shards = static_cast<int>(arenas_.size());
    std::vector<FitStepResult> results(arenas_.size());
    // The sampling run of total variation (see FitStep): contiguous vertices from a random
    // start, wrapping around, scaled so that the expectation is lambda times the mean over all.
    const int64_t vertices = state_.grid.frame.NumVertices();
    const int64_t run = static_cast<int64_t>(step.tv_fraction * static_cast<float>(vertices));
    const int64_t run_begin = static_cast<int64_t>(RandomIndex(
        seed_ ^ kRandomTotalVariation, step.number, 0, static_cast<uint64_t>(vertices)));
    const float tv_scale = run > 0 ? 1.0f / static_cast<float>(run) : 0.0f;

#pragma omp parallel for schedule(dynamic, 1)
    for (int s = 0; s < shards; ++s) {
      const int64_t begin = n * s / shards, end = n * (s + 1) / shards;
      const RayBatch batch{&batch_rays_[static_cast<size_t>(begin)],
                           &batch_targets_[static_cast<size_t>(begin)],
                           end - begin,
                           {step.losses.beta / static_cast<float>(n), step.losses.sparsity}};
      GradientArena* arena = &arenas_[static_cast<size_t>(s)];
      results[static_cast<size_t>(s)] =
          FastRays().accumulate(state_.grid, batch, step.march, scale, arena);
      for (int64_t v = run * s / shards; v < run * (s + 1) / shards;) {
        const int64_t from = (run_begin + v) % vertices;
        const int64_t count = std::min(run * (s + 1) / shards - v, vertices - from);
        FastRays().total_variation(state_.grid, from, from + count, step.tv_density * tv_scale,
                                   step.tv_sh * tv_scale, arena);
        v += count;
      }
      if (state_.grid.spheres.on()) RegularizeLayers(step, s, shards, &arena->spheres);
    }
    for (const FitStepResult& r : results) {
      sums_.squared_error += r.squared_error;
      sums_.samples += r.samples;
    }
  }

  // A sampling run of the map's texel columns (see FitStep).
  void RegularizeLayers(const FitStep& step, int shard, int shards, SphereArena* arena) const {
    const FastSpheres& spheres = state_.grid.spheres;
    const int64_t map = spheres.links.size();
    const int64_t run = static_cast<int64_t>(step.tv_sphere_fraction * static_cast<float>(map));
    if (run == 0) return;
    const int64_t first = static_cast<int64_t>(RandomIndex(
        seed_ ^ kRandomSphereVariation, step.number, 0, static_cast<uint64_t>(map)));
    const float scale = 1.0f / (static_cast<float>(run) * static_cast<float>(spheres.layers));
    for (int64_t v = run * shard / shards; v < run * (shard + 1) / shards;) {
      const int64_t from = (first + v) % map;
      const int64_t count = std::min(run * (shard + 1) / shards - v, map - from);
      SphereVariationGradient(spheres, from, from + count, step.tv_sphere_density * scale,
                              step.tv_sphere_color * scale, arena);
      v += count;
    }
  }

  void StepLayers(const RmspropOptions& optimizer) {
    std::vector<const SphereArena*> arenas;
    std::vector<std::pair<int, int64_t>> chunks;
    for (const GradientArena& arena : arenas_) {
      const int s = static_cast<int>(arenas.size());
      for (int64_t b = 0; b < arena.spheres.texel_of_slot.size(); b += kChunk)
        chunks.push_back({s, b});
      arenas.push_back(&arena.spheres);
    }
    int64_t rejected = 0;
#pragma omp parallel for schedule(dynamic, 4) reduction(+ : rejected)
    for (size_t c = 0; c < chunks.size(); ++c) {
      const auto [s, begin] = chunks[c];
      const int64_t size = arenas[static_cast<size_t>(s)]->texel_of_slot.size();
      rejected += StepSpheres(&state_.grid.spheres, state_.sphere_moment.data(), arenas.data(),
                              static_cast<int>(arenas.size()), s, begin,
                              std::min(begin + kChunk, size), optimizer);
    }
    sums_.rejected_voxels += rejected;
  }

  void StepVoxels(const RmspropOptions& optimizer) {
    const int shards = static_cast<int>(arenas_.size());
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
    sums_.rejected_voxels += rejected;
  }

  const TrainingRays* rays_;
  uint64_t seed_;
  FitState state_;
  FitSums sums_;
  std::vector<GradientArena> arenas_;
  std::vector<Ray> batch_rays_;
  std::vector<Vec3f> batch_targets_;
};

}  // namespace

std::unique_ptr<FitEngine> MakeCpuFitEngine(const TrainingRays* rays, uint64_t seed,
                                            int shards) {
  return std::make_unique<CpuFitEngine>(rays, seed, shards);
}

}  // namespace regrade
