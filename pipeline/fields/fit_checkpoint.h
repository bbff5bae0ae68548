// A fit's state as bytes, so that an interrupted fit goes on as if it had never stopped.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "reconstruct/fit/fit_field.h"

namespace regrade {

// Floats keep all their bits. `note`: what else the fit's stage wants back.
std::string PackFitState(const FitState& state, const std::string& note = "");

// Empty for bytes that are no such state.
std::optional<FitState> UnpackFitState(std::string_view bytes, std::string* note = nullptr);

}  // namespace regrade
