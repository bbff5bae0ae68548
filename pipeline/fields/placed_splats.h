// Splats in another frame.
#pragma once

#include <span>
#include <vector>

#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

// The same scene in another frame.
void MoveSplats(const Similarity& target_from_source, Splats* splats);

// The splats of `stored`, which has some, in the world of the capture's cameras.
Splats WorldSplats(const StoredField& stored);

// From right, down and front, the axes of cameras and of a PLY, to right, up and back, those of
// SPZ and glTF: a half turn about x, which is its own inverse. It changes signs only.
Mat3d HalfTurnAboutX();

// Colours [N, 3, basis] of splats that MoveSplats has moved, as they are in the frame before.
std::vector<float> ColorsBeforeMove(const Similarity& target_from_source,
                                    std::span<const float> sh, int basis);

}  // namespace regrade
