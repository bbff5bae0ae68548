// The root of the source tree. One file has it in its compile flags, so that the objects of all
// others are the same in every checkout, and a compiler cache can share them.
#pragma once

#include <string>

namespace regrade::testing {

std::string SourceDir();

}  // namespace regrade::testing
