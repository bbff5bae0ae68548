// Optimizer steps of a fit on the CPU or on CUDA; FitField has the schedule.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/density_losses.h"
#include "kernels/field/render.h"
#include "kernels/optimize/rmsprop.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {

// One optimizer step.
struct FitStep {
  uint64_t number = 0;  // since the fit began; seeds the random draws
  int rays = 0;
  int patch = 1;
  MarchOptions march;
  RmspropOptions optimizer;
  // The lambdas of density_losses.h, before the division by the rays.
  DensityLosses losses;
  // Total variation, with weights of its mean over all voxels. Each step regularises one
  // contiguous sampling run from a random start: tv_fraction of all grid vertices on the CPU,
  // tv_fraction of the stored voxels on the GPU; the expected gradient is the same.
  float tv_fraction = 0;
  float tv_density = 0;
  float tv_sh = 0;
  // The same for the background spheres, if any; runs are of texel columns on both.
  float tv_sphere_fraction = 0;
  float tv_sphere_density = 0;
  float tv_sphere_color = 0;
};

struct FitSums {
  double squared_error = 0;  // over rays and channels
  int64_t samples = 0;
  int64_t rejected_voxels = 0;
};

// Which voxels stay.
struct PruneLimits {
  bool by_density = false;  // or else by the largest rendering weight in any view
  float least = 0;
  int64_t max_voxels = 0;  // before resampling; see BoundedLimit; 0: no limit
};

class FitEngine {
 public:
  virtual ~FitEngine() = default;

  virtual void SetState(FitState state) = 0;
  // Calls `read` with the grid and the moments, without a copy where they are in host memory.
  // `read` may set stage, step and tally, and nothing else.
  virtual void ReadState(const std::function<void(FitState*)>& read) = 0;
  // Calls `edit` in the same way and continues from the edited state.
  virtual void EditState(const std::function<void(FitState*)>& edit) = 0;
  // No step follows: frees what only steps need, moments and gradients, as far as it can.
  virtual void EndSteps() {}
  virtual int64_t num_voxels() const = 0;
  virtual Vec3i resolution() const = 0;
  virtual void Step(const FitStep& step) = 0;
  virtual FitSums TakeSums() = 0;  // since the last call; may wait for queued steps
  // Renders the current field, colours clipped. Copies only the image to the host.
  virtual RenderedView Render(const Camera& camera, const MarchOptions& march) = 0;
  // Prunes voxels and resamples; resets the optimizer's state, as in svox2. Background spheres,
  // if any, get maps of `sphere_resolution` and are not pruned.
  virtual void Refine(const MarchOptions& march, const PruneLimits& limits,
                      const Vec3i& resolution, int sphere_resolution) = 0;
};

// `rays` and the photos behind it must outlive the engine. shards: gradient arenas of the CPU.
std::unique_ptr<FitEngine> MakeCpuFitEngine(const TrainingRays* rays, uint64_t seed,
                                            int shards);
// Throws Error(kResources) without CUDA. exact_sums: see FitOptions.
std::unique_ptr<FitEngine> MakeCudaFitEngine(const TrainingRays* rays, uint64_t seed,
                                             bool exact_sums);

}  // namespace regrade
