// Rays that are free up to some length, from the points that photos saw.
#pragma once

#include <vector>

#include "kernels/field/free_space.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// For each point that a photo saw, the ray to it: free up to the point less its uncertainty and
// less `margin` (the field's unit, or of device coordinates). As many rays again go through
// random pixels of the photos: they are free up to four fifths of the distance of the nearest
// of the eight points beside the pixel, for between points that were seen there is most often
// no other object much closer. Deterministic; no rays where photos saw no points.
std::vector<FreeRay> FreeRays(const std::vector<TrainingView>& views, double margin,
                              uint64_t seed);

}  // namespace regrade
