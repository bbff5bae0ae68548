// Splats of a file as the field of a run.
#pragma once

#include <span>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

// The same scene in another frame.
void MoveSplats(const Similarity& target_from_source, Splats* splats);

// Colours [N, 3, basis] of splats that MoveSplats has moved, as they are in the frame before.
std::vector<float> ColorsBeforeMove(const Similarity& target_from_source,
                                    std::span<const float> sh, int basis);

}  // namespace regrade
