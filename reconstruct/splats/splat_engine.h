// Optimizer steps of a splat fit on the CPU or on CUDA; FitSplats has the schedule.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "kernels/field/render.h"
#include "kernels/image/picture_loss.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splat_update.h"
#include "reconstruct/splats/fit_splats.h"
#include "reconstruct/splats/population.h"
#include "reconstruct/splats/splat_photos.h"

namespace regrade {

struct SplatStep {
  int photo = 0;
  float ssim_weight = 0, depth_weight = 0;
  SplatDropout dropout;
  SplatUpdate update;
};

struct SplatFitSums {
  PictureSums picture;
  int64_t entries = 0;   // splats in tiles
  int64_t rejected = 0;  // updates of splats, for a gradient that is not finite
};

class SplatEngine {
 public:
  virtual ~SplatEngine() = default;

  // Replaces the photos; they must outlive their use.
  virtual void SetPhotos(const SplatPhotos* photos) = 0;
  virtual void SetState(SplatFitState state) = 0;
  // Calls `read` with splats and moments. `read` may set step and tally, and nothing else.
  virtual void ReadState(const std::function<void(SplatFitState*)>& read) = 0;
  virtual int64_t count() const = 0;
  virtual int basis() const = 0;
  virtual std::vector<float> OpacityLogits() = 0;
  virtual void Change(const PopulationChange& change) = 0;
  // Harmonics of more degrees, 0 at first.
  virtual void SetBasis(int basis) = 0;
  virtual void Step(const SplatStep& step) = 0;
  virtual SplatFitSums TakeSums() = 0;  // since the last call; may wait for queued steps
  // Colours clipped. Copies only the picture to the host.
  virtual RenderedView Render(const Camera& camera) = 0;
};

std::unique_ptr<SplatEngine> MakeCpuSplatEngine(const SplatOptions& options);
// Throws Error(kResources) without CUDA.
std::unique_ptr<SplatEngine> MakeCudaSplatEngine(const SplatOptions& options);

}  // namespace regrade
