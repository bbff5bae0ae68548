// Moves an MP4 file's index (the moov atom) before its frames, so that a browser can start to
// play while it still loads.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

struct Mp4Atom {
  std::string type;    // four characters
  uint64_t begin = 0;  // byte of its size field
  uint64_t size = 0;   // with its header
};

// The top-level atoms of a file, which they fill exactly. Throws Error(kInput) with the byte
// offset otherwise.
std::vector<Mp4Atom> ListMp4Atoms(std::string_view file);

// The same movie with moov right behind ftyp; chunk offsets (stco, co64) follow their data. A
// file that already is in this order comes back unchanged. Sizes and counts are checked against
// the bytes there are. Throws Error(kInput) for what is not a plain MP4 file, such as one whose
// writer died before the index.
std::string MoveIndexFirst(std::string_view file);

}  // namespace regrade
