// What a fit takes of the processor that it runs on, and what it is lowered to where that is
// too much: one rule for `regrade run` and `regrade_gpu fit`.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/device/backend.h"
#include "pipeline/run/plan.h"

namespace regrade {

struct FitPlace {
  Backend backend = Backend::kCpu;
  int64_t pixels = 0;  // of the photos that are fitted, at working size
  SceneBox box = {};
  double max_memory_gb = 0;   // of 10^9 bytes; 0: what is free
  bool reproducible = false;  // free memory must not change the fit
};

StagePlan PlanFitAt(const FitPlace& place, const FitOptions& options);

struct PlannedFit {
  FitOptions options;
  StagePlan plan;
  std::string notice;  // a sentence on what was lowered; empty if nothing was
};

// The options, which AdaptOptions has seen, lowered by LowerToMemory; a reproducible fit only
// to a given limit. Throws Error(kResources) if the plan takes too much all the same.
PlannedFit FitWithinMemory(FitOptions options, const FitPlace& place);

// What a person should know of the fit's memory before it begins: that less than it takes is
// free, and what it is lowered to; or nothing.
std::string MemoryWarning(const FitOptions& options, const FitPlace& place);

}  // namespace regrade
