// The command that repeats a run: every option that differs from its preset.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"

namespace regrade {

// {"regrade", "run", SOURCE, "--out", ...}, without StartOptions and ProgramOptions.
std::vector<std::string> EquivalentCommand(const RunContext& context);

}  // namespace regrade
