// Matching by a list of pairs: which pairs, for frames of films, and COLMAP's commands.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_program.h"

namespace regrade {

using PhotoPairs = std::vector<std::pair<size_t, size_t>>;  // i < j, indices of photos

bool HasClips(const std::vector<StagedPhoto>& photos);

// Unique pairs in ascending order, for photos among which there are frames of films. A frame is
// matched with frames of its film up to 16 further on, denser near it; a photo with its
// neighbours in the order of names. Every eighth frame and up to kAnchorPhotos photos, evenly
// chosen, are matched all with all: they close loops and connect films with photos.
inline constexpr size_t kAnchorPhotos = 40;
PhotoPairs PairsOfClips(const std::vector<StagedPhoto>& photos);

// Runs COLMAP's matcher of listed pairs in batches, because it prints nothing until it ends.
// `run` gets the arguments of each and the fraction of the pairs in it; `list` is a file that
// is overwritten. `threads` 0: COLMAP chooses.
void MatchListed(const PhotoPairs& pairs, const std::vector<StagedPhoto>& photos,
                 const std::string& database, const std::string& list, int threads,
                 const std::function<void(const ColmapArguments&, double fraction)>& run);
inline constexpr char kListMatcher[] = "matches_importer";

}  // namespace regrade
