#include <algorithm>
#include <mutex>
#include <unordered_map>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "kernels/device/device_stream.h"

#if defined(__CUDACC__)
#include <nvtx3/nvToolsExt.h>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

void Require(cudaError_t status, const std::string& what) {
  if (status == cudaSuccess) return;
  throw Error(ExitCode::kResources, what + ": " + cudaGetErrorString(status), "GPU",
              "use --device cpu, or close what else runs on the GPU");
}

std::string Mebibytes(int64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

// Sizes of what is allocated. Never destroyed: owners of static lifetime free after it.
struct Allocations {
  std::mutex mutex;
  std::unordered_map<void*, int64_t> bytes;
  int64_t now = 0, peak = 0;
};
Allocations& AllAllocations() {
  static Allocations* const all = new Allocations;
  return *all;
}

void NoteAllocated(void* pointer, int64_t bytes) {
  Allocations& all = AllAllocations();
  const std::lock_guard lock(all.mutex);
  all.bytes[pointer] = bytes;
  all.now += bytes;
  all.peak = std::max(all.peak, all.now);
}

void NoteFreed(void* pointer) {
  Allocations& all = AllAllocations();
  const std::lock_guard lock(all.mutex);
  const auto found = all.bytes.find(pointer);
  if (found == all.bytes.end()) return;
  all.now -= found->second;
  all.bytes.erase(found);
}

}  // namespace

DeviceStatus ReadDeviceStatus() {
  DeviceStatus status;
  int count = 0;
  cudaError_t error = cudaGetDeviceCount(&count);
  cudaDeviceProp properties;
  if (error == cudaSuccess && count > 0) error = cudaGetDeviceProperties(&properties, 0);
  size_t free_bytes = 0, total_bytes = 0;
  if (error == cudaSuccess && count > 0) error = cudaMemGetInfo(&free_bytes, &total_bytes);
  if (error != cudaSuccess || count == 0) {
    cudaGetLastError();  // clear it: a missing driver must not fail the next call
    status.name = error != cudaSuccess ? cudaGetErrorString(error) : "no CUDA device";
    return status;
  }
  status.found = true;
  status.name = properties.name;
  status.compute_capability = 10 * properties.major + properties.minor;
  status.multiprocessors = properties.multiProcessorCount;
  status.free_bytes = static_cast<int64_t>(free_bytes);
  status.total_bytes = static_cast<int64_t>(total_bytes);
  return status;
}

void* DeviceAllocate(int64_t bytes, const char* what) {
  void* pointer = nullptr;
  const cudaError_t status = cudaMalloc(&pointer, static_cast<size_t>(bytes));
  if (status == cudaSuccess) {
    try {
      NoteAllocated(pointer, bytes);
    } catch (...) {
      cudaFree(pointer);
      throw;
    }
    return pointer;
  }
  cudaGetLastError();
  size_t free_bytes = 0, total_bytes = 0;
  cudaMemGetInfo(&free_bytes, &total_bytes);
  throw Error(ExitCode::kResources,
              std::string(what) + ": " + Mebibytes(bytes) +
                  " of GPU memory could not be allocated (" +
                  Mebibytes(static_cast<int64_t>(free_bytes)) + " of " +
                  Mebibytes(static_cast<int64_t>(total_bytes)) +
                  " free): " + cudaGetErrorString(status),
              "GPU", "use a coarser --preset, --device cpu, or close other GPU programs");
}

void DeviceFree(void* pointer) noexcept {
  if (pointer == nullptr) return;
  NoteFreed(pointer);
  cudaFree(pointer);
}

int64_t DevicePeakBytes() {
  Allocations& all = AllAllocations();
  const std::lock_guard lock(all.mutex);
  return all.peak;
}

DeviceRange::DeviceRange(const char* name) { nvtxRangePushA(name); }
DeviceRange::~DeviceRange() { nvtxRangePop(); }

void DeviceCopyIn(void* device, const void* host, int64_t bytes) {
  if (bytes > 0)
    Require(cudaMemcpy(device, host, static_cast<size_t>(bytes), cudaMemcpyHostToDevice),
            "copying to the GPU");
}

void DeviceCopyOut(void* host, const void* device, int64_t bytes) {
  if (bytes > 0)
    Require(cudaMemcpy(host, device, static_cast<size_t>(bytes), cudaMemcpyDeviceToHost),
            "copying from the GPU");
}

void DeviceCopyRows(void* to, int64_t to_pitch, const void* from, int64_t from_pitch,
                    int64_t bytes, int64_t rows) {
  if (rows > 0)
    Require(
        cudaMemcpy2D(to, static_cast<size_t>(to_pitch), from, static_cast<size_t>(from_pitch),
                     static_cast<size_t>(bytes), static_cast<size_t>(rows), cudaMemcpyDefault),
        "copying to or from the GPU");
}

void DeviceCopyWithin(void* to, const void* from, int64_t bytes) {
  if (bytes > 0)
    Require(cudaMemcpyAsync(to, from, static_cast<size_t>(bytes), cudaMemcpyDeviceToDevice,
                            LaunchStream()),
            "copying on the GPU");
}

void DeviceZero(void* device, int64_t bytes) {
  if (bytes > 0)
    Require(cudaMemsetAsync(device, 0, static_cast<size_t>(bytes), LaunchStream()),
            "clearing GPU memory");
}

void DeviceWait(const char* what) { Require(cudaDeviceSynchronize(), what); }

void CheckLaunch(const char* kernel) {
  Require(cudaGetLastError(), std::string("kernel ") + kernel);
}

#else

DeviceRange::DeviceRange(const char*) {}
DeviceRange::~DeviceRange() = default;

namespace {
[[noreturn]] void NoDevice() {
  throw Error(ExitCode::kResources, "this build has no CUDA", "GPU", "use --device cpu");
}
}  // namespace

DeviceStatus ReadDeviceStatus() {
  DeviceStatus status;
  status.name = "this build has no CUDA";
  return status;
}
void* DeviceAllocate(int64_t, const char*) { NoDevice(); }
void DeviceFree(void*) noexcept {}
int64_t DevicePeakBytes() { return 0; }
void DeviceCopyIn(void*, const void*, int64_t) { NoDevice(); }
void DeviceCopyOut(void*, const void*, int64_t) { NoDevice(); }
void DeviceCopyRows(void*, int64_t, const void*, int64_t, int64_t, int64_t) { NoDevice(); }
void DeviceCopyWithin(void*, const void*, int64_t) { NoDevice(); }
void DeviceZero(void*, int64_t) { NoDevice(); }
void DeviceWait(const char*) { NoDevice(); }
void CheckLaunch(const char*) { NoDevice(); }

#endif

}  // namespace regrade
