// A non-owning view of memory (pointer and length) for kernels on either processor.
#pragma once

#include <cstdint>

#include "kernels/base/host_device.h"

namespace regrade {

template <typename T>
struct View {
  T* data = nullptr;
  int64_t size = 0;

  HD T& operator[](int64_t i) const { return data[i]; }
  HD T* begin() const { return data; }
  HD T* end() const { return data + size; }
};

}  // namespace regrade
