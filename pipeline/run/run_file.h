// run.json: every option in effect; --config run.json repeats the run.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"

namespace regrade {

struct RunFile {
  std::vector<std::string> words;  // arguments that are not options, paths absolute
  JsonValue options;               // object
};

// Throws Error(kUsage) with line and column for what is not such a file.
RunFile ReadRunFile(const std::string& path);

// The content for `command`, with the fingerprints of finished stages.
JsonValue RunFileJson(const std::string& command, const RunContext& context);

void WriteRunFile(const std::string& command, const RunContext& context);

}  // namespace regrade
