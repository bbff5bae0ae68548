// regrade_gpu: the parts of regrade that need a GPU and neither COLMAP nor pictures' formats.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "pipeline/gpu/gpu_commands.h"
#include "pipeline/program/option_binding.h"

namespace regrade {
namespace {

constexpr char kUsage[] =
    "regrade_gpu " REGRADE_VERSION
    ": regrade on a machine with nothing but a CUDA driver\n\n"
    "usage: regrade_gpu device                       what the card is\n"
    "       regrade_gpu fit --capture FILE [OPTIONS]   a field from a file of `regrade pack`\n"
    "       regrade_gpu style --capture FILE --field FILE [OPTIONS]\n"
    "                                                that field in the colours of the file's "
    "style picture\n"
    "       regrade_gpu render --capture FILE --field FILE\n"
    "                                                what frames of it cost, and what "
    "exactness "
    "costs\n";

void PrintDevice() {
  const DeviceStatus status = ReadDeviceStatus();
  std::printf(
      "{\"found\": %s, \"name\": \"%s\", \"compute_capability\": %d, \"free_mib\": %lld}\n",
      status.found ? "true" : "false", status.name.c_str(), status.compute_capability,
      static_cast<long long>(status.free_bytes >> 20));
}

// It decides the defaults of the options that are read after it.
std::string RecipeOf(const std::vector<std::string>& arguments) {
  for (size_t i = 0; i + 1 < arguments.size(); ++i)
    if (arguments[i] == "--recipe") return arguments[i + 1];
  return "standard";
}

bool Run(const std::vector<std::string>& arguments) {
  const std::string command = arguments.empty() ? "help" : arguments[0];
  const std::vector<std::string> rest(arguments.begin() + !arguments.empty(), arguments.end());
  FitPackedOptions fit_packed;
  FitOptions fit;
  StylePackedOptions style_packed;
  RenderPackedOptions render_packed;
  TrainNetworkOptions network;
  OptionSet options;
  if (command == "fit") {
    options.Add("Capture", &fit_packed);
    options.Add("Fit", &fit);
  } else if (command == "style") {
    ApplyStyleRecipe(RecipeOf(rest), &network);
    options.Add("Capture", &style_packed);
    options.Add("Network", &network);
  } else if (command == "render") {
    options.Add("Capture", &render_packed);
  } else if (command == "device") {
    PrintDevice();
    return true;
  } else {
    std::printf("%s", kUsage);
    return command == "help" || command == "--help";
  }
  if (std::find(rest.begin(), rest.end(), "--help") != rest.end()) {
    std::printf("%s\n%s", kUsage, options.Help().c_str());
    return true;
  }
  options.Parse(rest);
  options.ApplyFlags();
  if (command == "fit")
    FitPacked(fit_packed, fit);
  else if (command == "render")
    RenderPacked(render_packed);
  else
    StylePacked(style_packed, network);
  return true;
}

}  // namespace
}  // namespace regrade

int main(int argc, char** argv) {
  try {
    return regrade::Run(std::vector<std::string>(argv + std::min(argc, 1), argv + argc)) ? 0
                                                                                         : 1;
  } catch (const regrade::Error& error) {
    std::fprintf(stderr, "regrade_gpu: %s\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "regrade_gpu: a bug of ours: %s\n", error.what());
    return 1;
  }
}
