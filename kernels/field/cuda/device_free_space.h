// EQ(free-space) on a CUDA device.
#pragma once

#include <memory>
#include <vector>

#include "kernels/device/device_memory.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/free_space.h"

namespace regrade {

// Draws from a list of free rays and adds their gradients, beside the work of the default
// stream: a thread walks a ray twice, and few threads are busy.
class DeviceFreeSpace {
 public:
  explicit DeviceFreeSpace(const std::vector<FreeRay>& rays);
  ~DeviceFreeSpace();
  int64_t size() const { return rays_.size(); }
  // Adds the gradient of `weight` times the mean opacity of n drawn rays. Waits for what the
  // default stream was given before; that stream must call Join before it reads the gradients.
  void Accumulate(const DeviceGrid& grid, uint64_t seed, uint64_t step, int n, float weight,
                  DeviceTouched* touched);
  void Join();

 private:
  struct Stream;
  DeviceBuffer<FreeRay> rays_;
  std::unique_ptr<Stream> stream_;
};

}  // namespace regrade
