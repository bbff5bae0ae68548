// The colmap program as we use it: found, its version checked, its options spelled as the
// installed version spells them, its last words turned into an error that helps.
#pragma once

#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "kernels/process/child_process.h"

namespace regrade {

// Names without the leading dashes, as COLMAP 3.8 knows them.
using ColmapArguments = std::vector<std::pair<std::string, std::string>>;

class ColmapProgram {
 public:
  struct Limits {
    double wall_s = 0;   // 0: none
    double quiet_s = 0;  // 0: none
  };

  // `program` is a name on PATH or a path. Logs go to `log_folder`, which exists. Throws
  // Error(kExternalProgram) if it is missing, is not COLMAP, or is older than 3.7.
  ColmapProgram(const std::string& program, const std::string& log_folder);

  const std::string& version() const { return version_; }  // "3.8"
  const std::string& log_folder() const { return log_folder_; }

  // Runs one command; its log is `log_folder`/`log_name`.log. Options that this version has
  // under another name are renamed, tuning options that it does not have are left out. Throws
  // Error(kResources) when the log speaks of a full disk (COLMAP exits with 0 then); every
  // other outcome is returned.
  ChildResult Run(const std::string& command, const ColmapArguments& arguments,
                  const std::string& log_name, const Limits& limits,
                  const LineFunction& on_line = {}, const KeepGoingFunction& keep_going = {});

  // The error for a command that failed, with the end of its log.
  [[noreturn]] void Fail(const std::string& command, const ChildResult& result,
                         const std::string& log_name) const;

 private:
  const std::set<std::string>& OptionsOf(const std::string& command);
  std::vector<std::string> Spelled(const std::string& command,
                                   const ColmapArguments& arguments);
  std::string LogPath(const std::string& log_name) const;

  std::string program_, log_folder_, version_;
  std::map<std::string, std::set<std::string>> options_;
};

}  // namespace regrade
