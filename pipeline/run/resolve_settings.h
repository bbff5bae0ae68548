// Decides the value of every option from presets, run.json files and flags: the only place that
// has their order.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/program/option_binding.h"

namespace regrade {

// Options of a continued folder that run or read something outside of it.
using OutsideOptions = std::vector<OptionSet::Outside>;

struct SettingsSources {
  std::string preset = "standard";      // where neither a flag nor a run.json names one
  std::string run_json = "";            // file of the run that a command continues; empty: none
  std::string folder = "";              // of that run: what it names in there is its own
  std::vector<std::string> taken = {};  // names of the options taken from it; empty: all
  // Asked about what `run_json` names outside, where neither flags nor --config do: true takes
  // it. Without this function and after a no, such options keep their defaults.
  std::function<bool(const OutsideOptions&)> accept_outside = {};
};

// Writes the options that are bound in `options`, whose flags have been parsed. Later sources
// override earlier ones:
//   1. the preset: that of the run.json, or else of `sources`
//   2. `sources.run_json`, without options of one start, then a run.json of --config
//   3. --preset, for the options that presets set
//   4. paper-config of --config, with the preset paper, for what it decides
//   5. --recipe, for all options of the style network
//   6. single options of --config
//   7. flags
//   8. "reproducible" with the device "cuda": exact sums of the fit and the style
// Options of presets and recipes that are not in the set are skipped. Returns the arguments of
// `sources.run_json`, or else of --config. Throws Error(kUsage).
std::vector<std::string> ResolveSettings(const SettingsSources& sources, OptionSet* options);

}  // namespace regrade
