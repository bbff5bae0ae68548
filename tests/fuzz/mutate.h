// Changes to bytes and texts that readers have been known to trip over.
#pragma once

#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace regrade::testing {

// A few of: a count or size set to an edge (0, 1, a little more or less, powers of two, all
// ones) at any width in either byte order, flipped bits, a piece cut out, doubled or moved, the
// end cut off, zeros put in.
std::string MutateBytes(std::string bytes, FuzzRandom* random);

// The same for words and numbers: a number becomes an edge or no number at all, a piece between
// separators goes, comes twice or changes places, brackets pile up, a word of `dictionary` is
// put in.
std::string MutateText(std::string text, const std::vector<std::string>& dictionary,
                       FuzzRandom* random);

// Of JSON, with the words of our files.
std::string MutateJson(std::string text, FuzzRandom* random);

}  // namespace regrade::testing
