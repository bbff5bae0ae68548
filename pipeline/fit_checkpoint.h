// A fit's state as bytes, so that an interrupted fit goes on as if it had never stopped.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "reconstruct/fit_field.h"

namespace regrade {

// Floats keep all their bits.
std::string PackFitState(const FitState& state);

// Empty for bytes that are no such state.
std::optional<FitState> UnpackFitState(std::string_view bytes);

}  // namespace regrade
