// Tries the networks of the evaluation before any long work.
#pragma once

#include "evaluate/consistency.h"

namespace regrade {

// Runs each network of `options` on two small pictures in a child process with limits (see
// crash_probe.h), and opens its file here. Throws Error(kExternalProgram) that names it.
void ProbeEvaluationNetworks(const ConsistencyOptions& options);

}  // namespace regrade
