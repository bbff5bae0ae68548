// What is known of a fit before it begins, and how it is made, for each kind of field.
#pragma once

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/run/field_fit.h"
#include "pipeline/run/fit_memory.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// An option whose values `regrade tradeoff` compares, from cheap to accurate.
struct MeasuredOption {
  std::string benchmark, option;
  JsonValue own;  // the settings' value; null of what is no option of a run
  std::vector<JsonValue> values;
  bool last_is_accurate = true;
};

struct FitKind {
  const char* name;  // "voxels" or "splats", as --field has it
  // Rough seconds of two threads (AMD EPYC) for a million pixels of a film, of both fields.
  double film_frame;

  JsonValue (*options)(const RunSettings& settings);
  int (*sh_degree)(const RunSettings& settings);
  // What this kind cannot go with. Throws Error(kUsage).
  void (*check)(const RunSettings& settings);
  // Before it is lowered to what memory holds.
  StagePlan (*plan)(const RunSettings& settings, const FitPlace& place);
  // What it would store, likewise.
  PlannedField (*field)(const RunSettings& settings, const FitPlace& place);
  // Lowers the settings to what memory holds, and says so, or returns an empty text. Throws
  // Error(kResources).
  std::string (*lower)(const FitPlace& place, RunSettings* settings);
  std::vector<MeasuredOption> (*measured)(const RunSettings& settings);
  // With `settings` adapted to `place`. Seeds and sums follow the settings, too.
  std::unique_ptr<FieldFit> (*make)(const RunSettings& settings, const FitPlace& place);
};

const std::array<const FitKind*, 2>& FitKinds();
// Of the field that the settings name.
const FitKind& FitKindOf(const RunSettings& settings);

// As the function of that name for a draft; 1 for every other fit.
int64_t OnePhotoIn(const RunSettings& settings, const FitPlace& place);

// What memory leaves of a fit: the photos of the place, the settings, and what a person should
// know of it, or nothing. Throws Error(kResources) where nothing is left.
struct FitInMemory {
  FitPlace place;
  RunSettings settings;
  std::string notice;
};
FitInMemory Lowered(const RunSettings& settings, const FitPlace& place);

// What a person should know of the fit's memory before it begins: that less than it takes is
// free, how many photos of the place's it is left, and what it is lowered to; or nothing.
std::string MemoryWarning(const RunSettings& settings, const FitPlace& place);

}  // namespace regrade
