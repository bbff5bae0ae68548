// Joins the films of parts, without encoding anything again.
#pragma once

#include <string>
#include <vector>

namespace regrade {

// Writes to `path`, as VideoWriter does, the film whose frames are those of `parts`, films of
// VideoWriter's, one after the other. Where each but the last has kFilmGroup frames or a
// multiple of them, its bytes are those of one VideoWriter that was given all frames. Throws
// Error(kInput) with the name of a part that cannot be read or differs from the first in size
// or rate, Error(kResources) if a write failed.
void JoinFilms(const std::vector<std::string>& parts, const std::string& path);

}  // namespace regrade
