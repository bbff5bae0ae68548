// The rays of a training step: a pure function of seed and step.
#pragma once

#include <cstdint>
#include <vector>

#include "stylize/field/gradient_aggregation.h"
#include "stylize/training/train_network.h"

namespace regrade {

// Patches of patch x patch neighbouring pixels at random places of random views, about `rays`
// of them; neighbours share voxels, and a step costs what its voxels cost.
StyleRays SampleStyleRays(const std::vector<StyledTrainingView>& views, int rays, int patch,
                          uint64_t seed, uint64_t step);

// All rays of one view: a random one, or with `passes` the next of a random order that each
// pass over the views has of its own.
StyleRays WholeViewRays(const std::vector<StyledTrainingView>& views, bool passes,
                        uint64_t seed, uint64_t step);

// Rays of a step of patches; 0 for one of a whole view.
int64_t RaysPerStep(int rays, int patch);

// Checks sizes and values; returns the number of pixels that are not finite.
int64_t ValidateViews(const std::vector<StyledTrainingView>& views);

}  // namespace regrade
