// The styles of a page.
#pragma once

#include <string>
#include <vector>

#include "pipeline/commands/command.h"

namespace regrade {

inline constexpr size_t kMostPageStyles = 16;

// Of the words DIR [STYLE ...]: the styles that are named, or all whole-scene styles of the
// folder that have a network. Throws Error(kInput), also for a folder without a field, and for
// scene or styles that are not what was recorded.
std::vector<std::string> WantedStyles(const std::string& folder, const Arguments& words);

}  // namespace regrade
