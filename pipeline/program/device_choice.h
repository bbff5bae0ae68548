// Chooses the processor that a run uses.
#pragma once

#include <string>

#include "kernels/device/backend.h"

namespace regrade {

// `device`: "auto", "cpu" or "cuda". auto chooses the GPU where there is one, and the CPU for a
// reproducible run, because processors round differently: its bytes must not depend on whether
// there is a GPU. Throws Error(kResources) for "cuda" without a GPU.
Backend ChooseBackend(const std::string& device, bool reproducible);

// Whether settings are chosen for a card: where "cuda" is asked for, or ChooseBackend would
// take one.
bool PrefersCard(const std::string& device, bool reproducible);

// "cpu", or the GPU's name.
std::string DeviceName(Backend backend);

}  // namespace regrade
