// The networks and edge maps that options name, opened for the metrics of fidelity.
#pragma once

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"

namespace regrade {

// Sets `perceptual`, `edges` and, where there is a style picture, `style_features`, which the
// picture passes through once. Errors: those of the networks.
void OpenNetworks(const ConsistencyOptions& options, FidelityTargets* targets);

}  // namespace regrade
