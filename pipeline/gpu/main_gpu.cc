// regrade_gpu: the parts of regrade that need a GPU and neither COLMAP nor image files.
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/device/device_memory.h"
#include "pipeline/gpu/gpu_options.h"

namespace regrade {
namespace {

constexpr char kUsage[] =
    "regrade_gpu " REGRADE_VERSION
    ": regrade on a machine with a CUDA driver and the shared libraries that it is linked to\n"
    "(libzip, Boost, libgomp and theirs); no COLMAP, no OpenCV, no picture formats\n\n"
    "usage: regrade_gpu device                       prints the card's name and memory\n"
    "       regrade_gpu fit --capture FILE [OPTIONS]   fits a field to a file of `regrade "
    "pack`\n"
    "       regrade_gpu splats --capture FILE [OPTIONS]\n"
    "                                                fits splats to it, and measures them\n"
    "       regrade_gpu style --capture FILE --field FILE [OPTIONS]\n"
    "                                                restyles it after the file's style "
    "picture\n"
    "       regrade_gpu render --capture FILE --field FILE\n"
    "                                                measures frame times and errors of "
    "faster settings\n";

void PrintDevice() {
  const DeviceStatus status = ReadDeviceStatus();
  std::printf(
      "{\"found\": %s, \"name\": \"%s\", \"compute_capability\": %d, \"free_mib\": %lld}\n",
      status.found ? "true" : "false", status.name.c_str(), status.compute_capability,
      static_cast<long long>(status.free_bytes >> 20));
}

bool Run(const std::vector<std::string>& arguments) {
  const std::string command = arguments.empty() ? "help" : arguments[0];
  const std::vector<std::string> rest(arguments.begin() + !arguments.empty(), arguments.end());
  if (command == "device") {
    PrintDevice();
    return true;
  }
  GpuSettings settings;
  OptionSet options;
  if (!settings.Bind(command, &options)) {
    std::printf("%s", kUsage);
    return command == "help" || command == "--help";
  }
  if (std::ranges::find(rest, "--help") != rest.end()) {
    std::printf("%s\n%s", kUsage, options.Help().c_str());
    return true;
  }
  ReadFlags(rest, &options);
  if (command == "fit")
    FitPacked(settings.fit_packed, settings.fit, &options);
  else if (command == "splats")
    FitSplatsPacked(settings.fit_splats, settings.splats);
  else if (command == "render")
    RenderPacked(settings.render_packed);
  else
    StylePacked(settings.style_packed, settings.network);
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
  } catch (const regrade::Interrupted&) {
    std::fprintf(stderr, "regrade_gpu: stopped; the same command continues\n");
    return 130;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "regrade_gpu: internal error: %s\n", error.what());
    return 1;
  }
}
