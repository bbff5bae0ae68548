// The only launcher of kernel bodies: body(i) for i in [0, n), on OpenMP threads or on a CUDA
// grid.
#pragma once

#include <cstdint>

#include "kernels/base/error.h"
#include "kernels/base/host_device.h"

namespace regrade {

enum class Backend { kCpu, kCuda };

#if defined(__CUDACC__)
template <typename Body>
__global__ void ForEachKernel(int64_t n, Body body) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i < n) body(i);
}
#endif

// `body` is a plain struct with `HD void operator()(int64_t) const`; bodies must not depend on
// each other. `name` labels errors and profiles. Launches on the device are asynchronous on the
// default stream.
template <typename Body>
void ForEach(Backend backend, const char* name, int64_t n, const Body& body) {
  if (n <= 0) return;
#if defined(__CUDACC__)
  if (backend == Backend::kCuda) {
    constexpr int kThreads = 128;
    ForEachKernel<<<static_cast<unsigned>((n + kThreads - 1) / kThreads), kThreads>>>(n, body);
    const cudaError_t status = cudaGetLastError();
    if (status != cudaSuccess)
      throw Error(ExitCode::kResources,
                  std::string("kernel ") + name + ": " + cudaGetErrorString(status));
    return;
  }
#endif
  if (backend == Backend::kCuda)
    throw Error(ExitCode::kResources, "this build has no CUDA", name, "use --device cpu");
#pragma omp parallel for schedule(dynamic, 64)
  for (int64_t i = 0; i < n; ++i) body(i);
}

}  // namespace regrade
