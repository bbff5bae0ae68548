// run.json: every option in effect, so that feeding it back repeats the run.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"

namespace regrade {

struct RunFile {
  std::vector<std::string> words;  // what stood behind the command, paths absolute
  JsonValue options;               // object
};

// Throws Error(kUsage) with line and column for what is not such a file.
RunFile ReadRunFile(const std::string& path);

// What `command` would write, with the fingerprints of the stages that are finished.
JsonValue RunFileJson(const std::string& command, const RunContext& context);

void WriteRunFile(const std::string& command, const RunContext& context);

}  // namespace regrade
