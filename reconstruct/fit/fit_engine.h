// What a fit does at each step, on one processor or the other; FitField holds the schedule.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "kernels/device/backend.h"
#include "kernels/field/render.h"
#include "kernels/optimize/rmsprop.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {

// One optimizer step.
struct FitStep {
  uint64_t number = 0;  // since the fit began: what random draws depend on
  int rays = 0;
  int patch = 1;
  MarchOptions march;
  RmspropOptions optimizer;
  // Total variation: the share of the voxels regularised, and the weights of its mean over all.
  float tv_share = 0;
  float tv_density = 0;
  float tv_sh = 0;
  // The same of the background's layers, where there are some.
  float tv_sphere_share = 0;
  float tv_sphere_density = 0;
  float tv_sphere_color = 0;
};

struct FitSums {
  double squared_error = 0;  // over rays and channels
  int64_t samples = 0;
  int64_t rejected_voxels = 0;
};

class FitEngine {
 public:
  virtual ~FitEngine() = default;

  virtual void Take(FitState state) = 0;  // goes on from it
  // Shows grid and moments; a processor that has them in the host's memory copies nothing.
  // `use` may set stage and step.
  virtual void Show(const std::function<void(FitState*)>& use) = 0;
  // The same, and goes on from what `use` has made of them.
  virtual void Change(const std::function<void(FitState*)>& use) = 0;
  virtual int64_t num_voxels() const = 0;
  virtual Vec3i resolution() const = 0;
  virtual void Step(const FitStep& step) = 0;
  virtual FitSums TakeSums() = 0;  // since the last call; may wait for steps to finish
  // The field as it is now, colours clipped. Nothing of it leaves the device but the picture.
  virtual RenderedView Render(const Camera& camera, const MarchOptions& march) = 0;
  // Prunes voxels that weigh less than `threshold` in every view and resamples; the optimizer's
  // state starts anew, as in svox2. Background layers, where there are some, get maps of
  // `sphere_resolution` and are not pruned.
  virtual void Refine(const MarchOptions& march, float threshold, const Vec3i& resolution,
                      int sphere_resolution) = 0;
};

// `rays` and what it was made from stay with the caller. shards: gradient arenas of the CPU.
std::unique_ptr<FitEngine> MakeCpuFitEngine(const TrainingRays* rays, uint64_t seed,
                                            int shards);
// Throws Error(kResources) without CUDA. exact_sums: see FitOptions.
std::unique_ptr<FitEngine> MakeCudaFitEngine(const TrainingRays* rays, uint64_t seed,
                                             bool exact_sums);

}  // namespace regrade
