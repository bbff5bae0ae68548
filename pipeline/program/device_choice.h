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

// "cuda:N" shows this process, and those that it starts, one graphics card alone: the N-th,
// from 0 on, of those that CUDA_VISIBLE_DEVICES lists, or else of all in nvidia-smi's order.
// Returns "cuda" then, and any other text as it is. Comes before the first look for a card.
// Throws Error(kUsage) where N is no number, Error(kResources) where the list is shorter.
std::string ShowOneCard(const std::string& device);

// "cpu", or the GPU's name.
std::string DeviceName(Backend backend);

}  // namespace regrade
