// Copies of a splat that together look as it did.
//
// EQ(splat-relocation), Kheradmand et al. 2024, eq. 9: n splats at one place, each with the
// opacity and the scales
//   o' = 1 - (1 - o)^(1 / n),
//   s' = s o / sum_{i=1..n} sum_{k=0..i-1} C(i-1, k) (-1)^k o'^(k+1) / sqrt(k + 1),
// have at their middle the opacity of the one splat before, and along a line through it the
// same integral. Summed over i first, C(n, k+1) = sum_{i>k} C(i-1, k), the terms are at most (n
// o')^(k+1) / (k+1)!, and n o' <= -ln(1 - o): the alternating sum keeps its digits.
#pragma once

namespace regrade {

inline constexpr int kMostCopies = 50;

struct SplatCopies {
  double opacity;    // o'
  double log_scale;  // ln(s' / s)
};

// opacity in (0, 1); copies in 1 .. kMostCopies.
SplatCopies CopiesOf(double opacity, int copies);

}  // namespace regrade
