// How splats multiply and move during a fit, Kheradmand et al. 2024, section 3.3: dead ones go
// to places drawn by opacity, and new ones begin there. What is drawn depends on opacities,
// seed and step alone.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/splats/population_change.h"

namespace regrade {

// Moves splats of opacity below kDeadOpacity, or not finite, to places of others.
PopulationChange MoveDead(const std::vector<float>& opacity_logits, uint64_t seed,
                          uint64_t step);
// Appends up to `more` splats at places of splats that are not dead.
PopulationChange Grow(const std::vector<float>& opacity_logits, int64_t more, uint64_t seed,
                      uint64_t step);

// The same of splats that stand behind `before` others.
PopulationChange Behind(int64_t before, PopulationChange change);

}  // namespace regrade
