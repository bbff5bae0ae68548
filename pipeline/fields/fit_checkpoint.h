// Packs a fit's state into bytes: a resumed fit gives the same result as an uninterrupted one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "pipeline/files/byte_packing.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {

// Floats keep all their bits. `note`: further data of the fit's stage. The result refers to the
// state's arrays.
BytePacker PackFitState(const FitState& state, const std::string& note = "");

// Empty if the bytes are not such a state.
std::optional<FitState> UnpackFitState(std::string_view bytes, std::string* note = nullptr);

}  // namespace regrade
