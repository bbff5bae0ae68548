// The command that does what a run did: every option that is not what its preset says.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"

namespace regrade {

// {"regrade", "run", SOURCE, "--out", ...}. How one start behaves is no part of it.
std::vector<std::string> EquivalentCommand(const RunContext& context);

}  // namespace regrade
