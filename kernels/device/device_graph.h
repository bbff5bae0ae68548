// Work on a CUDA device that is recorded once and then played without the host: a step of many
// short kernels costs what they cost, not what launching them does.
#pragma once

#include <functional>
#include <utility>

namespace regrade {

class DeviceGraph {
 public:
  DeviceGraph() = default;
  ~DeviceGraph();
  DeviceGraph(const DeviceGraph&) = delete;
  DeviceGraph& operator=(const DeviceGraph&) = delete;

  // Kernels that `body` launches through LaunchStream(), DeviceZero and DeviceCopyWithin are
  // recorded and not run. `body` must not allocate, free, wait, or copy to or from the host.
  // What was recorded before is forgotten. Throws Error(kResources).
  void Record(const std::function<void()>& body);
  bool recorded() const { return playable_ != nullptr; }
  // Behind what was launched before; does not wait.
  void Play() const;

 private:
  void Forget() noexcept;
  void* playable_ = nullptr;  // cudaGraphExec_t
};

}  // namespace regrade
