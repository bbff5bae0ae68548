// What a run will cost on another capture, from what one was seen to cost: seconds of a stage
// for each unit of its work.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/tradeoff/measurements.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// A stage's time is a sum of terms, each so much a unit of work that is known before it begins.
struct CostTerm {
  std::string stage, unit;
  double seconds = 0, cpu_seconds = 0;  // a unit
};

struct StageTime {
  std::string stage;
  double seconds = 0, cpu_seconds = 0;
};

// How much of `unit` a run of these settings does:
//   trials: of view dependence, 1 or 0, the same work for every capture |
//   photo megapixels: at matching size | ray voxels: rays times the grid's side, over the fit |
//   photo pixels: at working size | staged pixels: as they were given | style rays |
//   frame pixels | pair pixels
double AmountOf(const std::string& unit, const RunSettings& settings, const Capture& capture);

// From the records of a finished run; where parameters of steps and grids were measured, by
// least squares of relative errors over them. A fit's steps have a price of their own, and what
// the stage took beside them and its trial of degrees (photos, held-out views) goes by staged
// pixels.
std::vector<CostTerm> LearnCosts(const RunSettings& base, const Capture& capture,
                                 const Workspace& workspace,
                                 const std::vector<Variant>& variants,
                                 const std::vector<Measurement>& measurements);

std::vector<StageTime> Predict(const std::vector<CostTerm>& costs, const RunSettings& settings,
                               const Capture& capture);

JsonValue ToJson(const std::vector<CostTerm>& costs);
// Throws Error(kInput).
std::vector<CostTerm> CostsFromJson(const JsonValue& json, const std::string& where);

}  // namespace regrade
