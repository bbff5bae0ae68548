// Photos with EXIF orientation and given poses: whether the poses are of the pictures as stored
// or turned upright.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {

// The photos at the sizes that their files have, before EXIF orientation.
std::vector<StagedPhoto> AsStored(std::vector<StagedPhoto> photos);

// Brings `model`, which has staged names, and the staged `photos`, which are upright, together.
// COLMAP up to version 3 ignores EXIF orientation, and later versions obey it: the sizes of the
// cameras tell, or where pictures have the same size either way, the points, whose observations
// have the more similar colours in the right reading. Where nothing tells, poses are of the
// pictures as stored. Cameras of stored pictures are turned upright; a photo whose orientation
// mirrors it is staged again as stored instead, with its new size. Returns a sentence for the
// user, empty if no photo with a pose has an orientation. Throws Error(kResources).
std::string MatchOrientations(ColmapModel* model, std::vector<StagedPhoto>* photos);

}  // namespace regrade
