// Device memory that is kept between calls and grows by halves.
#pragma once

#include <algorithm>

#include "kernels/device/device_memory.h"

namespace regrade {

// Makes `buffer` hold at least `size` values; their contents are lost if it grows.
template <typename T>
void GrowBuffer(int64_t size, const char* what, DeviceBuffer<T>* buffer) {
  if (size <= buffer->size()) return;
  const int64_t grown = std::max(size, buffer->size() + buffer->size() / 2);
  *buffer = {};  // frees the old memory first
  *buffer = DeviceBuffer<T>(grown, what);
}

}  // namespace regrade
