// What a fit of voxels or splats takes of the processor that it runs on, and what it is lowered
// to where that is too much.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "kernels/device/backend.h"
#include "pipeline/run/plan.h"
#include "reconstruct/fit/fit_options.h"
#include "reconstruct/scene/scene_box.h"
#include "reconstruct/splats/splat_fit_options.h"

namespace regrade {

struct FitPlace {
  Backend backend = Backend::kCpu;
  int64_t pixels = 0;  // of the photos that are fitted, at working size
  int64_t photos = 0;  // that are fitted
  SceneBox box = {};
  double max_memory_gb = 0;   // of 10^9 bytes; 0: what is free
  bool reproducible = false;  // free memory must not change the fit
  // Of a block of splats: those around it, and photos are decoded one by one.
  int64_t frozen_splats = 0;
  bool is_block = false;
};

StagePlan PlanFitAt(const FitPlace& place, const FitOptions& options);
StagePlan PlanSplatsAt(const FitPlace& place, const SplatFitOptions& options);

// Fitting one photo in so many leaves a quarter of --max-memory to the field; 1 where all do,
// and without that limit. `plan`: of a place, before anything is lowered.
int64_t OnePhotoIn(const FitPlace& place,
                   const std::function<StagePlan(const FitPlace&)>& plan);
// "one photo in 3 is fitted, 117 of 350, to fit into --max-memory"
std::string FewerPhotosText(int64_t one_in, int64_t fitted, const FitPlace& place);

// Lowers the resolutions of the finest stages, to no less than kLeastResolution, until the plan
// takes at most `limit` bytes. Returns false if nothing was lowered. Half the voxels cost about
// 1 dB.
inline constexpr int kLeastResolution = 64;
bool LowerToMemory(const std::function<StagePlan(const FitOptions&)>& plan_of, uint64_t limit,
                   FitOptions* options);
// Lowers the most splats, to no less than kLeastSplats thousands, as LowerToMemory does.
inline constexpr float kLeastSplats = 5;
bool LowerSplatsToMemory(const std::function<StagePlan(const SplatFitOptions&)>& plan_of,
                         uint64_t limit, SplatFitOptions* options);

struct PlannedFit {
  FitOptions options;
  StagePlan plan;
  std::string notice;  // a sentence on what was lowered; empty if nothing was
};

// The options, which AdaptOptions has seen, lowered by LowerToMemory; a reproducible fit only
// to a given limit. Throws Error(kResources) if the plan takes too much all the same.
PlannedFit FitWithinMemory(FitOptions options, const FitPlace& place);

struct PlannedSplatFit {
  SplatFitOptions options;
  StagePlan plan;
  std::string notice;
};

// At most one splat for each kPixelsOfSplat pixels of the photos; with more, few photos are
// explained one by one, and views between them get worse.
inline constexpr int kPixelsOfSplat = 15;
SplatFitOptions AtMostOfPixels(SplatFitOptions options, const FitPlace& place);
// As FitWithinMemory, and first AtMostOfPixels; not below `there`, which the fit begins with.
PlannedSplatFit SplatsWithinMemory(SplatFitOptions options, const FitPlace& place,
                                   int64_t there = 0);

// AdaptOptions for the place.
FitOptions AdaptedTo(const FitOptions& options, const FitPlace& place);

}  // namespace regrade
