// Joins the films of parts, without encoding anything again.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace regrade {

struct FilmPart {
  std::string path;    // of a film of VideoWriter's
  int64_t frames = 0;  // that it must have
};

// Writes to `path`, as VideoWriter does, the film whose frames are those of `parts`, one after
// the other. Where each but the last has kFilmGroup frames or a multiple of them, its bytes are
// those of one VideoWriter that was given all frames. Throws Error(kInput) with the name of a
// part that cannot be read, has not its frames, or is not encoded as the first;
// Error(kResources) if a write failed.
void JoinFilms(const std::vector<FilmPart>& parts, const std::string& path);

}  // namespace regrade
