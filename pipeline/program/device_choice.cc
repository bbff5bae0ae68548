#include "pipeline/program/device_choice.h"

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"

namespace regrade {
namespace {

constexpr int kLeastCapability = 75;  // of this build: Turing and later

}  // namespace

Backend ChooseBackend(const std::string& device, bool reproducible) {
  if (device == "cpu") return Backend::kCpu;
  if (reproducible && device == "auto") return Backend::kCpu;
  const DeviceStatus status = ReadDeviceStatus();
  if (status.found && status.compute_capability >= kLeastCapability) return Backend::kCuda;
  if (device == "cuda")
    throw ResourceError(
        status.found ? status.name + " is older than this build supports" : status.name,
        "--device cuda", "use --device auto or cpu");
  return Backend::kCpu;
}

bool PrefersCard(const std::string& device, bool reproducible) {
  return device == "cuda" || ChooseBackend(device, reproducible) == Backend::kCuda;
}

std::string DeviceName(Backend backend) {
  return backend == Backend::kCpu ? "cpu" : ReadDeviceStatus().name;
}

}  // namespace regrade
