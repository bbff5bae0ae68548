// Runs the built program, or another one, and keeps what it says.
#pragma once

#include <gtest/gtest.h>

#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/process/child_process.h"

#define EXPECT_SAYS(outcome, part) \
  EXPECT_NE(outcome.text.find(part), std::string::npos) << outcome.text

namespace regrade::testing {

struct ProgramOutcome {
  int code = 0;
  std::string text;
};

// The words of a line.
inline std::vector<std::string> Words(const std::string& line) {
  std::istringstream words(line);
  return {std::istream_iterator<std::string>(words), {}};
}

inline std::vector<std::string> Joined(std::vector<std::string> words,
                                       const std::vector<std::string>& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

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

inline bool HaveColmap() {
  try {
    return RunProgram("colmap", {"help"}).code == 0;
  } catch (const Error&) {
    return false;
  }
}

#ifdef REGRADE_PROGRAM
inline ProgramOutcome Regrade(const std::vector<std::string>& arguments,
                              const std::vector<std::string>& more = {}) {
  return RunProgram(REGRADE_PROGRAM, Joined(arguments, more));
}

inline int ExitCodeOf(const std::vector<std::string>& arguments) {
  return Regrade(arguments).code;
}

// `regrade pose` by the poses of the capture; its exit code.
inline int PoseCode(const std::string& capture, const std::string& out) {
  return ExitCodeOf({"pose", capture, "--out", out, "--tracks", "given"});
}

// Its output; it has to end with `code`.
inline std::string Said(const std::vector<std::string>& arguments, int code = 0) {
  const ProgramOutcome outcome = Regrade(arguments);
  EXPECT_EQ(outcome.code, code) << outcome.text;
  return outcome.text;
}
#endif

}  // namespace regrade::testing
