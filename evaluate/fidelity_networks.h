// The networks and edge maps that options name, opened for the metrics of fidelity.
#pragma once

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"

namespace regrade {

// Sets `perceptual` and `edges`. Errors: those of the networks.
void OpenNetworks(const ConsistencyOptions& options, FidelityTargets* targets);

}  // namespace regrade
