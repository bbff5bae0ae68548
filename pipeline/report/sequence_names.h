// What the report page calls the sequences of frames.
#pragma once

#include <string>

namespace regrade {

// "styled" -> "styled scene", "path_source" -> "film, before styling"; others unchanged.
std::string SequenceLabel(const std::string& sequence);

}  // namespace regrade
