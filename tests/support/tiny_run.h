// Runs the built program on a synthetic capture so small that a whole run takes seconds.
#pragma once

#include <string>
#include <vector>

#include "pipeline/synth/synth_capture.h"
#include "tests/support/run_program.h"

namespace regrade::testing {

// `regrade synth`, without a start of the program.
inline void WriteCapture(const std::string& folder, int views, const std::string& size) {
  SynthOptions options;
  options.views = views;
  options.size = size;
  WriteSyntheticCapture(folder, options, {});
}

// Options for the smallest possible fit, style and film: three frames, at which it is measured,
// too. Without a field none is fitted: of splats that are given.
inline std::vector<std::string> TinyFlags(const std::string& field = "splats") {
  std::vector<std::string> flags = {
      "--photo-size", "64", "--style-steps", "3", "--film-seconds", "0.125", "--fps", "24",
      "--film-size",  "64", "--threads",     "2", "--tracks",       "given"};
  if (field.empty()) return flags;
  const std::vector<std::string> fit =
      field == "splats"
          ? std::vector<std::string>{"--field", field, "--splat-steps", "60", "--splats", "2"}
          : std::vector<std::string>{"--field", field,         "--fit-resolutions",
                                     "24",      "--fit-steps", "30"};
  flags.insert(flags.end(), fit.begin(), fit.end());
  return flags;
}

}  // namespace regrade::testing
