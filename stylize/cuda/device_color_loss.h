// The loss of rendered rays on a CUDA device: EQ(liprf-loss) without its normalisation, and
// what goes back.
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/device/device_memory.h"

namespace regrade {

struct DeviceColorLoss {
  double loss = 0;              // sum of squared differences as the loss sees them
  double squared_error = 0;     // as a clipped picture shows them
  unsigned long long rays = 0;  // that count
};

struct ColorLossRule {
  float max_transmittance =
      1;  // rays that let more light through do not count, nor do non-finite targets
  bool one_sided = false;  // see ErrorOf
};

// d_color [n] = 2 (color - target), 0 where a ray does not count; adds to *sums, which lies on
// the device: a ray's terms are rounded to multiples of 2^-26, so that sums do not depend on
// the order of rays.
void AddColorLoss(const Vec3f* color, const Vec3f* targets, const float* transmittance,
                  int64_t n, const ColorLossRule& rule, Vec3f* d_color, DeviceColorLoss* sums);

}  // namespace regrade
