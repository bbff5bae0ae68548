// What a failed call says about a file, for a person.
#pragma once

#include <string>

namespace regrade {

// The text of an errno of open and the like: "is a link" for what OpenOwnFile refuses.
std::string FileProblem(int error);

// What to do about it: `otherwise`, except where space or a limit of the system is the reason.
std::string FileRemedy(int error, const std::string& otherwise);

}  // namespace regrade
