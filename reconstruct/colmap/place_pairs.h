// Which photos to match by where they were taken, as a drone's or a phone's receiver tells.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/listed_pairs.h"

namespace regrade {

// True if nearly all photos know their place, and most neighbours are farther apart than a
// receiver errs: the places of a room's photos say nothing.
bool PlacesTellPhotosApart(const std::vector<StagedPhoto>& photos);

// Unique pairs in ascending order: each photo with those taken nearest to it, and with its
// neighbours in the order of names, which photos without a place have alone. The cost grows
// linearly with the number of photos.
PhotoPairs PairsOfPlaces(const std::vector<StagedPhoto>& photos);

}  // namespace regrade
