// Which processor a run uses.
#pragma once

#include <functional>
#include <string>

#include "kernels/base/for_each.h"

namespace regrade {

// `device`: "auto", "cpu" or "cuda". auto takes the GPU where there is one, and the CPU for a
// reproducible run: the GPU's sums have no fixed order. Throws Error(kResources) if "cuda" was
// asked for and there is none, Error(kUsage) if it was asked for together with `reproducible`.
Backend ChooseBackend(const std::string& device, bool reproducible);

// The same for work on a field: one with background spheres is worked on by the CPU, for the
// GPU has none yet, and `say` is told so in a sentence where a GPU would have been taken.
Backend ChooseBackendFor(bool spheres, const std::string& device, bool reproducible,
                         const std::function<void(const std::string&)>& say);

// "cpu", or the GPU's name.
std::string DeviceName(Backend backend);

}  // namespace regrade
