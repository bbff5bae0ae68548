// Splats that are copied to other places of the arrays, or behind them.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/splats/splats.h"

namespace regrade {

// A splat that is copied: it and its copies get this opacity, and its scales times
// exp(log_factor).
struct CopiedSplat {
  int32_t index;
  float opacity_logit, log_factor;
};
struct SplatCopy {
  int32_t from, to;
};

// First the copied ones change, then the copies are made. Each `to` occurs once, and is no
// `from`.
struct PopulationChange {
  std::vector<CopiedSplat> copied;
  std::vector<SplatCopy> copies;
  int64_t count = 0;  // afterwards
};

// Of moments (`moments`), those of copied splats and their copies become 0.
void ApplyChange(const PopulationChange& change, bool moments, Splats* splats);

// Harmonics of more degrees, which are 0.
void PadBasis(int basis, Splats* splats);

}  // namespace regrade
