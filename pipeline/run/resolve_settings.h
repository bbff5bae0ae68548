// Decides the value of every option from presets, run.json files and flags: the only place that
// has their order.
#pragma once

#include <string>
#include <vector>

#include "pipeline/program/option_binding.h"

namespace regrade {

struct SettingsSources {
  std::string preset = "standard";      // where neither a flag nor a run.json names one
  std::string run_json = "";            // file of the run that a command continues; empty: none
  std::vector<std::string> taken = {};  // names of the options taken from it; empty: all
};

// Writes the options that are bound in `options`, whose flags have been parsed. Later sources
// override earlier ones:
//   1. the preset: that of the run.json, or else of `sources`
//   2. `sources.run_json`, then the file of --config
//   3. --preset, for the options that presets set
//   4. --paper-config, with the preset paper, for what it decides
//   5. --recipe, for all options of the style network
//   6. single flags
//   7. "reproducible" with the device "cuda": exact sums of the fit and the style
// Options of presets and recipes that are not in the set are skipped. Returns the arguments of
// `sources.run_json`, or else of --config. Throws Error(kUsage).
std::vector<std::string> ResolveSettings(const SettingsSources& sources, OptionSet* options);

}  // namespace regrade
