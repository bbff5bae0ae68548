// The state of a network's training as bytes, so that an interrupted training goes on as if it
// had never stopped.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "stylize/training/train_network.h"

namespace regrade {

// Floats keep all their bits.
std::string PackTrainingState(const TrainingState& state);

// Empty for bytes that are no such state.
std::optional<TrainingState> UnpackTrainingState(std::string_view bytes);

}  // namespace regrade
