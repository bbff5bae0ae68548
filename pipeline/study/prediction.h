// Predicts the time of a run on another capture from measured seconds per unit of work of each
// stage.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/run/fit_memory.h"
#include "pipeline/run/run_context.h"
#include "pipeline/study/measurements.h"

namespace regrade {

// One term of a stage's time, proportional to an amount of work that is known in advance.
struct CostTerm {
  std::string stage, unit;
  double seconds = 0, cpu_seconds = 0;  // per unit
};

struct StageTime {
  std::string stage;
  double seconds = 0, cpu_seconds = 0;
};

// Of a fit on the CPU: its photos and their pixels, at working size.
FitPlace PlaceOf(const RunSettings& settings, const Capture& capture);
// Before any photo is read, see ExpectedPixels.
FitPlace ExpectedPlace(const RunSettings& settings, int64_t photos);

// The amount of `unit` in a run with these settings:
//   trials: of view dependence, 1 or 0, the same work for every capture |
//   photo megapixels: at matching size | ray voxels: rays times the grid's side, over all
//   stages of the fit | planned seconds: of a fit of splats |
//   photo pixels: at working size | staged pixels: at the original size | style rays |
//   frame pixels | pair pixels
double AmountOf(const std::string& unit, const RunSettings& settings, const Capture& capture);

// Costs from the records of a finished run, or by least squares of relative errors over
// measured numbers of steps and grid sizes. The rest of the reconstruct stage, without a fit's
// steps and the trial of degrees (that is, reading photos and held-out views), is per staged
// pixel.
std::vector<CostTerm> LearnCosts(const RunContext& run, const Capture& capture,
                                 const std::vector<Variant>& variants,
                                 const std::vector<Measurement>& measurements);

// Throws Error(kInput) where the costs are of fits of the other kind of field.
std::vector<StageTime> Predict(const std::vector<CostTerm>& costs, const RunSettings& settings,
                               const Capture& capture);

JsonValue ToJson(const std::vector<CostTerm>& costs);
// The unit costs of a tradeoff.json. Throws Error(kInput).
std::vector<CostTerm> CostsFromJson(const JsonValue& json, const std::string& where);

}  // namespace regrade
