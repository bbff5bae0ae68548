// Splats in a device's memory, or a gradient by them.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/splats.h"

namespace regrade {

// The arrays of SplatsView, which may have room for more splats than there are: 44 + 12 basis
// bytes for each.
struct DeviceSplats {
  DeviceBuffer<float> mean, log_scale, quaternion, opacity_logit, sh;
  int64_t count = 0;
  int basis = 1;
  Vec3f background{};

  DeviceSplats() = default;
  // Without values. Throws Error(kResources).
  DeviceSplats(int64_t capacity, int basis);

  int64_t capacity() const { return opacity_logit.size(); }
  // Room for at least `capacity` splats; keeps the values. Throws Error(kResources).
  void Reserve(int64_t capacity);
  // Replaces all splats, and the basis; 0 has no coefficients.
  void Upload(const SplatsView<float>& splats);
  void Upload(const Splats& splats) { Upload(splats.view()); }
  Splats Download() const;
  // Sets all values of the `count` splats to 0.
  void Zero();

  SplatsView<float> view() const {
    return {mean.data(),
            log_scale.data(),
            quaternion.data(),
            opacity_logit.data(),
            sh.data(),
            count,
            basis,
            background};
  }
};

}  // namespace regrade
