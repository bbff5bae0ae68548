// Mutations of bytes and texts that often break readers.
#pragma once

#include <string>
#include <vector>

#include "tests/fuzz/fuzz_target.h"

namespace regrade::testing {

// Some of: a count or size set to an edge case (0, 1, slightly more or less, powers of two, all
// ones) of any width and byte order, flipped bits, a piece removed, doubled or moved, the end
// cut off, zeros inserted.
std::string MutateBytes(std::string bytes, FuzzRandom* random);

// The same for words and numbers: a number becomes an edge case or invalid, a piece between
// separators is removed, doubled or moved, brackets are nested, a word of `dictionary` is
// inserted.
std::string MutateText(std::string text, const std::vector<std::string>& dictionary,
                       FuzzRandom* random);

// Of JSON, with the keys of our files.
std::string MutateJson(std::string text, FuzzRandom* random);

}  // namespace regrade::testing
