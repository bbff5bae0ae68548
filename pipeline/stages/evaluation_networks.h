// Networks that evaluation is given, tried before any long work.
#pragma once

#include "evaluate/consistency.h"

namespace regrade {

// Each network of `options` looks at two small pictures in a child process with limits (see
// crash_probe.h), and its file is opened here. Throws Error(kExternalProgram) that names it.
void ProbeEvaluationNetworks(const ConsistencyOptions& options);

}  // namespace regrade
