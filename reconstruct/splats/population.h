// How splats multiply and move during a fit, Kheradmand et al. 2024, section 3.3: dead ones go
// to places drawn by opacity, and new ones begin there. What is drawn depends on opacities,
// seed and step alone.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/splats/population_change.h"

namespace regrade {

inline constexpr int kMostCopies = 50;

// Copies of a splat that together look as it did.
//
// EQ(splat-relocation), Kheradmand et al. 2024, eq. 9: n splats at one place, each with the
// opacity and the scales
//   o' = 1 - (1 - o)^(1 / n),
//   s' = s o / sum_{i=1..n} sum_{k=0..i-1} C(i-1, k) (-1)^k o'^(k+1) / sqrt(k + 1),
// have at their middle the opacity of the one splat before, and along a line through it the
// same integral. Summed over i first, C(n, k+1) = sum_{i>k} C(i-1, k), the terms are at most (n
// o')^(k+1) / (k+1)!, and n o' <= -ln(1 - o): the alternating sum keeps its digits.
struct SplatCopies {
  double opacity;    // o'
  double log_scale;  // ln(s' / s)
};

// opacity in (0, 1); copies in 1 .. kMostCopies.
SplatCopies CopiesOf(double opacity, int copies);

// Moves splats of opacity below kDeadOpacity, or not finite, to places of others.
PopulationChange MoveDead(const std::vector<float>& opacity_logits, uint64_t seed,
                          uint64_t step);
// Appends up to `more` splats at places of splats that are not dead.
PopulationChange Grow(const std::vector<float>& opacity_logits, int64_t more, uint64_t seed,
                      uint64_t step);

// The same of splats that stand behind `before` others.
PopulationChange Behind(int64_t before, PopulationChange change);

}  // namespace regrade
