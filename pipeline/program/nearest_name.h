// "Did you mean ...?": the known name nearest to a mistyped one.
#pragma once

#include <string>
#include <vector>

namespace regrade {

// Edits (insert, delete, replace, swap of neighbours) that turn one text into the other.
int EditDistance(const std::string& a, const std::string& b);

// The name with the fewest edits, or one that `typed` is the beginning of; empty if all are
// further than a third of the typed length (at least 2).
std::string NearestName(const std::string& typed, const std::vector<std::string>& names);

}  // namespace regrade
