// Splats of a file that another program wrote.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/splats/splats.h"

namespace regrade {

enum class SplatFormat { kPly, kCompressedPly, kSpz, kSplat };

struct SplatScene {
  SplatFormat format = SplatFormat::kPly;
  // In the world of the cameras: x right, y down, z front, in the units of the file. At least
  // one splat, in the order of the file, and all of them usable; see CleanRecord for what is
  // changed. The background is black.
  Splats splats;
  bool antialiased = false;  // the file says that it was fitted with Mip-Splatting's filter

  int64_t records = 0;               // in the file
  int64_t dropped = 0;               // of these, not in `splats`: they cannot be drawn
  int64_t first_dropped = -1;        // the index of the first one
  std::vector<std::string> ignored;  // "property a", "element b": what is not read
  std::vector<std::string> notes;    // sentences about what else was left out
};

}  // namespace regrade
