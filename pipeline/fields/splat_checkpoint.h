// Packs the state of a fit of splats into bytes: a resumed fit gives the same result as an
// uninterrupted one.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "pipeline/files/byte_packing.h"
#include "reconstruct/splats/fit_splats.h"

namespace regrade {

// As PackFitState and UnpackFitState.
BytePacker PackSplatFitState(const SplatFitState& state, const std::string& note);
std::optional<SplatFitState> UnpackSplatFitState(std::string_view bytes, std::string* note);

}  // namespace regrade
