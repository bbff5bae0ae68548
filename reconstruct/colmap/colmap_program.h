// Runs the colmap program: checks its version, translates option names, and turns failures into
// errors with the end of its log.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "kernels/process/child_process.h"

namespace regrade {

// Option names of COLMAP 3.8 without the leading dashes, and values.
using ColmapArguments = std::vector<std::pair<std::string, std::string>>;

class ColmapProgram {
 public:
  struct Limits {
    double wall_s = 0;   // 0: none
    double quiet_s = 0;  // 0: none
  };

  // `program` is a name on PATH or a path. Logs go to `log_folder`, which exists. `gpu`: "off";
  // "on"; or "auto", on if this COLMAP was built with CUDA. Throws Error(kExternalProgram) if
  // it is missing, is not COLMAP, is older than 3.7, or has no CUDA with "on".
  ColmapProgram(const std::string& program, const std::string& log_folder,
                const std::string& gpu = "off");

  const std::string& version() const { return version_; }  // "3.8"
  const std::string& log_folder() const { return log_folder_; }

  // Runs one command, on the GPU where it can and may; with "auto", again on the CPU if it
  // fails there. Its log is `log_folder`/`log_name`.log. Renames options to the installed
  // version's names and omits tuning options that it does not have. Throws Error(kResources) if
  // the log reports a full disk (COLMAP exits with 0 then), Interrupted if `keep_going` returns
  // false; returns all other outcomes.
  ChildResult Run(const std::string& command, const ColmapArguments& arguments,
                  const std::string& log_name, const Limits& limits,
                  const LineFunction& on_line = {}, const KeepGoingFunction& keep_going = {});

  // Sentences for the user since the last call.
  std::vector<std::string> TakeNotes() { return std::exchange(notes_, {}); }

  // Throws the error for a failed command, with the end of its log.
  [[noreturn]] void Fail(const std::string& command, const ChildResult& result,
                         const std::string& log_name) const;

 private:
  ChildResult RunOnce(const std::string& command, const ColmapArguments& arguments,
                      const std::string& log_name, const Limits& limits,
                      const LineFunction& on_line, const KeepGoingFunction& keep_going);
  const std::set<std::string>& OptionsOf(const std::string& command);
  std::vector<std::string> CommandLine(const std::string& command,
                                       const ColmapArguments& arguments);
  std::string LogPath(const std::string& log_name) const;

  std::string program_, log_folder_, version_;
  bool use_gpu_ = false, may_fall_back_ = false;
  std::vector<std::string> notes_;
  std::map<std::string, std::set<std::string>> options_;
};

}  // namespace regrade
