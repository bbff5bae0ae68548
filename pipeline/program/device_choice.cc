#include "pipeline/program/device_choice.h"

#include <charconv>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "pipeline/files/text.h"

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

std::string ShowOneCard(const std::string& device) {
  constexpr std::string_view kBegin = "cuda:";
  if (!device.starts_with(kBegin)) return device;
  const std::string_view text = std::string_view(device).substr(kBegin.size());
  int number = -1;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || number < 0)
    throw UsageError("'" + device + "' is not allowed", "--device",
                     "give the card's number, such as cuda:1 for the second");
  std::string shown = std::to_string(number);
  if (const char* list = std::getenv("CUDA_VISIBLE_DEVICES")) {
    const std::vector<std::string> cards = Split(list, ',');
    if (number >= std::ssize(cards))
      throw ResourceError(Concat("CUDA_VISIBLE_DEVICES lists ", std::ssize(cards), " cards"),
                          "--device " + device, "give a smaller number, from 0 on");
    shown = cards[static_cast<size_t>(number)];
  }
  setenv("CUDA_VISIBLE_DEVICES", shown.c_str(), 1);
  setenv("CUDA_DEVICE_ORDER", "PCI_BUS_ID", 0);
  return "cuda";
}

std::string DeviceName(Backend backend) {
  return backend == Backend::kCpu ? "cpu" : ReadDeviceStatus().name;
}

}  // namespace regrade
