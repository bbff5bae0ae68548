// Which processor a run uses.
#pragma once

#include <string>

#include "kernels/device/backend.h"

namespace regrade {

// `device`: "auto", "cpu" or "cuda". auto takes the GPU where there is one, and the CPU for a
// reproducible run: the GPU's sums have no fixed order. Throws Error(kResources) if "cuda" was
// asked for and there is none, Error(kUsage) if it was asked for together with `reproducible`.
Backend ChooseBackend(const std::string& device, bool reproducible);

// "cpu", or the GPU's name.
std::string DeviceName(Backend backend);

}  // namespace regrade
