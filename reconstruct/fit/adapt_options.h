// What the fit's options become for a capture: one rule for all captures.
#pragma once

#include <cstdint>

#include "reconstruct/fit/fit_options.h"

namespace regrade {

struct FitConditions {
  bool on_card = false;
  int64_t pixels = 0;  // of the photos that are fitted
};

// Rays per step, where they are 0: 4096 on a CPU; on a card as many as make kPasses passes over
// the photos' pixels in all steps, from 4096 to 14336. Fewer passes leave captures of many
// photos soft (COSTS.md). Applied twice with the same conditions, it changes nothing more.
FitOptions AdaptOptions(FitOptions options, const FitConditions& conditions);

inline constexpr int kPasses = 16;

}  // namespace regrade
