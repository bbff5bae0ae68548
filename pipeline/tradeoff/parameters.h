// The parameters that have a price: which option, at which values, and on which plane of
// accuracy over time they are compared.
#pragma once

#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// Where variants compare with each other: they have one measure of accuracy and one of time.
struct Benchmark {
  const char* name;      // "fit"
  const char* accuracy;  // what is measured, "held-out PSNR"
  const char* unit;      // of it
  bool more_is_better;
  const char* time_of;  // what the seconds are of
};

inline constexpr Benchmark kBenchmarks[] = {
    {"poses", "reprojection error", "px", false, "finding the poses"},
    {"fit", "held-out PSNR", "dB", true, "a fit's steps, photos read before"},
    {"style", "PSNR to the 2D method on the renders", "dB", true, "learning a style"},
    {"render", "RMS difference to the accurate end, of 255 levels", "levels", false, "a frame"},
    {"flow", "mean end-point error against exact motion", "px", false, "a pair, both ways"},
};

const Benchmark& BenchmarkOf(const std::string& name);

// One thing to measure: options that differ from the base's.
struct Variant {
  std::string benchmark, parameter,
      value;  // parameter "" is the base itself, "preset" a whole preset
  JsonValue options = JsonValue::Object();
  bool accurate_end = false;  // what the parameter's errors are measured against
};

struct ParameterChoice {
  std::vector<std::string> only;  // of these parameters; empty for all
  bool poses = false, style = false;
  std::vector<std::string> presets;
};

// The base of each plane, then each parameter's values from cheap to accurate. Values follow
// the base's own: half its steps and twice as many, a coarser grid and a finer one. Throws
// Error(kUsage) for a name in `only` that is no parameter.
std::vector<Variant> VariantsOf(const RunSettings& base, const ParameterChoice& choice);

// The options of groups Scene and Fit that a preset sets.
JsonValue PresetOptions(const std::string& preset);

}  // namespace regrade
