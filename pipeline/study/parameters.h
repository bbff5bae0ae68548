// The parameters to measure: option, values, and the benchmark in which they are compared.
#pragma once

#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// Variants are compared within a benchmark, which has one measure of accuracy and one of time.
struct Benchmark {
  const char* name;      // "fit"
  const char* accuracy;  // its measure, "held-out PSNR"
  const char* unit;      // of accuracy
  bool more_is_better;
  const char* time_of;  // the work that is timed
};

inline constexpr Benchmark kBenchmarks[] = {
    {"poses", "reprojection error", "px", false, "finding the poses"},
    {"fit", "held-out PSNR", "dB", true, "a fit's steps, without reading photos"},
    {"style", "PSNR to the 2D method on the renders", "dB", true, "training a style"},
    {"render", "RMS difference to the accurate end, in 255 levels", "levels", false, "a frame"},
    {"flow", "mean end-point error against exact motion", "px", false,
     "a pair, both directions"},
};

const Benchmark& BenchmarkOf(const std::string& name);

// A set of options to measure, as differences from the base.
struct Variant {
  std::string benchmark, parameter, value;  // parameter "": the base; "preset": a whole preset
  JsonValue options = JsonValue::Object();
  bool accurate_end = false;  // errors of the parameter are relative to it
};

struct ParameterChoice {
  std::vector<std::string> only;       // these parameters; empty: all
  bool photos = false, style = false;  // photos: without poses
  std::vector<std::string> presets;
};

// The base of each benchmark, then each parameter's values from cheap to accurate. Values are
// relative to the base's: half and twice its steps or splats, a coarser and a finer grid.
// Throws Error(kUsage) for an unknown name in `only`.
std::vector<Variant> VariantsOf(const RunSettings& base, const ParameterChoice& choice);

// A preset's values of the options in the groups Scene and Fit.
JsonValue PresetOptions(const std::string& preset);

}  // namespace regrade
