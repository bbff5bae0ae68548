// Runs the built program on a synthetic capture so small that a whole run takes seconds.
#pragma once

#include <string>
#include <vector>

#include "kernels/process/child_process.h"
#include "pipeline/synth/synth_capture.h"

namespace regrade::testing {

struct ProgramOutcome {
  int code = 0;
  std::string text;
};

inline ProgramOutcome RunProgram(const std::string& program,
                                 const std::vector<std::string>& arguments) {
  ChildOptions options;
  options.argv = {program};
  options.argv.insert(options.argv.end(), arguments.begin(), arguments.end());
  options.wall_limit_s = 300;
  ProgramOutcome outcome;
  const ChildResult result =
      RunChild(options, [&outcome](const std::string& line) { outcome.text += line + "\n"; });
  outcome.code = result.end == ChildEnd::kExited ? result.exit_status : 128 + result.signal;
  return outcome;
}

inline ProgramOutcome Regrade(const std::vector<std::string>& arguments) {
  return RunProgram(REGRADE_PROGRAM, arguments);
}

inline int ExitCodeOf(const std::vector<std::string>& arguments) {
  return Regrade(arguments).code;
}

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
