// Packs the state of a network's training into bytes: a resumed training gives the same result
// as an uninterrupted one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "stylize/training/train_network.h"

namespace regrade {

// Floats keep all their bits.
std::string PackTrainingState(const TrainingState& state);

// Empty if the bytes are not such a state.
std::optional<TrainingState> UnpackTrainingState(std::string_view bytes);

}  // namespace regrade
