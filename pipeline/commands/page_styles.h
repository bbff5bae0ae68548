// The styles of a page.
#pragma once

#include <string>
#include <vector>

#include "pipeline/commands/command.h"

namespace regrade {

inline constexpr size_t kMostPageStyles = 16;

// Of the words DIR [STYLE ...]: the styles that are named, or all of the folder that were
// learned; the others are added to `left`, if that is not null. Throws Error(kInput), also for
// a folder without a field, for a named style that was not learned, and for scene or styles
// that are not what was recorded.
std::vector<std::string> WantedStyles(const std::string& folder, const Arguments& words,
                                      std::vector<std::string>* left = nullptr);

}  // namespace regrade
