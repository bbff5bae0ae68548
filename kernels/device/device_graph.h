// A CUDA graph: a step of many short kernels is captured once and launched as one unit, which
// removes the launch overhead of each kernel.
#pragma once

#include <functional>

namespace regrade {

class DeviceGraph {
 public:
  DeviceGraph() = default;
  ~DeviceGraph();
  DeviceGraph(const DeviceGraph&) = delete;
  DeviceGraph& operator=(const DeviceGraph&) = delete;

  // Captures, without running them, the kernels that `body` launches through LaunchStream() and
  // the calls of DeviceZero and DeviceCopyWithin. `body` must not allocate, free, wait, or copy
  // to or from the host. Replaces the previous capture. Throws Error(kResources).
  void Capture(const std::function<void()>& body);
  bool captured() const { return executable_ != nullptr; }
  // Enqueued after all earlier launches; does not wait.
  void Launch() const;

 private:
  void Forget() noexcept;
  void* executable_ = nullptr;  // cudaGraphExec_t
};

}  // namespace regrade
