// Memory of a CUDA device: owners, copies and errors that name the memory. Builds without CUDA
// have the same interface, and every call throws Error(kResources).
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "kernels/base/buffer.h"
#include "kernels/base/view.h"

namespace regrade {

struct DeviceStatus {
  bool found = false;
  std::string name;            // "NVIDIA H200", or why no device is available
  int compute_capability = 0;  // 90 for 9.0
  int multiprocessors = 0;
  int64_t free_bytes = 0;
  int64_t total_bytes = 0;
};
// Of device 0; never throws.
DeviceStatus ReadDeviceStatus();

// `what` names the memory in errors ("gradients of 5600000 voxels"). Throws Error(kResources)
// with the requested and the free size.
void* DeviceAllocate(int64_t bytes, const char* what);
void DeviceFree(void* pointer) noexcept;
// The most bytes that this program has had allocated at once, without those of the driver.
int64_t DevicePeakBytes();
void DeviceCopyIn(void* device, const void* host, int64_t bytes);
void DeviceCopyOut(void* host, const void* device, int64_t bytes);  // waits for running kernels
// Copies rows of `bytes` each; rows begin `to_pitch` and `from_pitch` bytes apart. Any
// direction.
void DeviceCopyRows(void* to, int64_t to_pitch, const void* from, int64_t from_pitch,
                    int64_t bytes, int64_t rows);
void DeviceCopyWithin(void* to, const void* from, int64_t bytes);
void DeviceZero(void* device, int64_t bytes);
// Waits; throws Error(kResources) with the first failure of any earlier kernel.
void DeviceWait(const char* what);
// Call it right after a launch: reports a launch that could not start, by its kernel's name.
void CheckLaunch(const char* kernel);

// A named range of work for Nsight (NVTX); does nothing without a profiler.
class DeviceRange {
 public:
  explicit DeviceRange(const char* name);
  ~DeviceRange();
  DeviceRange(const DeviceRange&) = delete;
  DeviceRange& operator=(const DeviceRange&) = delete;
};

// Owner of trivially copyable values on the device. Contents are undefined until written.
template <typename T>
class DeviceBuffer {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  DeviceBuffer() = default;
  DeviceBuffer(int64_t size, const char* what) : size_(size) {
    if (size > 0)
      data_ = static_cast<T*>(DeviceAllocate(size * static_cast<int64_t>(sizeof(T)), what));
  }
  DeviceBuffer(const DeviceBuffer&) = delete;
  DeviceBuffer(DeviceBuffer&& other) noexcept { Swap(other); }
  DeviceBuffer& operator=(DeviceBuffer&& other) noexcept {
    Swap(other);
    return *this;
  }
  ~DeviceBuffer() { DeviceFree(data_); }

  void CopyIn(const T* host, int64_t count) { DeviceCopyIn(data_, host, count * kBytes); }
  void CopyOut(T* host, int64_t count) const { DeviceCopyOut(host, data_, count * kBytes); }
  void Zero() { DeviceZero(data_, size_ * kBytes); }

  static DeviceBuffer Of(const Buffer<T>& host, const char* what) {
    DeviceBuffer buffer(host.size(), what);
    buffer.CopyIn(host.data(), host.size());
    return buffer;
  }
  Buffer<T> ToHost() const {
    Buffer<T> host(size_);
    CopyOut(host.data(), size_);
    return host;
  }

  T* data() const { return data_; }
  int64_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

 private:
  static constexpr int64_t kBytes = sizeof(T);
  void Swap(DeviceBuffer& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }
  T* data_ = nullptr;
  int64_t size_ = 0;
};

}  // namespace regrade
