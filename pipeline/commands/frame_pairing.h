// Which frames of several folders are the same moment, by the names of their files.
#pragma once

#include <string>
#include <vector>

#include "pipeline/commands/frame_folder.h"

namespace regrade {

// For each name of a reference the one that belongs to it.
struct NamePairs {
  std::vector<int> partner;  // index of a name, or -1
  std::string by;            // "number", "name", or "order" where neither says anything
};

// By number (see FrameNumbers), where both have numbers and share two of them, or all; else by
// the same name less extension, under the same condition; else by order.
NamePairs PairNames(const std::vector<std::string>& reference,
                    const std::vector<std::string>& names);

// How the frames of one folder were paired with those of the reference.
struct FramePairing {
  std::string folder, by;
  std::vector<std::string> left_out, reference_left_out;  // names without a counterpart
  std::string notice;  // a sentence, unless all frames have a counterpart of their name
};

// Leaves in every folder the frames that all of them have, so that frame i is the same moment
// in each. One entry for each of `sequences`; an entry that is the reference itself, by
// address, is passed over.
//
// Errors (kInput): frames of another size, another number of frames without names that say
// which is which, no common frame, and frames left out in between, so that pairs across them
// would be further apart than their gap.
std::vector<FramePairing> PairFolders(FrameFolder* reference,
                                      const std::vector<FrameFolder*>& sequences);

}  // namespace regrade
