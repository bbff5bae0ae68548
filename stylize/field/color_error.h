// How far a rendered colour is from its target, for the loss of EQ(liprf-loss) and for the
// figure beside it.
#pragma once

#include "kernels/base/host_device.h"

namespace regrade {

// Difference that the loss sees, and that a clipped picture shows.
struct ColorError {
  float loss, shown;
};

// One-sided: a colour at or above 1 whose target is 1, or at or below 0 whose target is 0, is
// no error.
HD inline ColorError ErrorOf(float color, float target, bool one_sided) {
  const auto clip = [](float x) { return x < 0 ? 0.0f : x > 1 ? 1.0f : x; };
  const bool clipped = (color >= 1 && target >= 1) || (color <= 0 && target <= 0);
  return {one_sided && clipped ? 0.0f : color - target, clip(color) - clip(target)};
}

}  // namespace regrade
