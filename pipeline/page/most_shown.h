// The splats of a large field that a page can do without least.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Indices of all splats, first those with the largest sums, over all pixels of the cameras, of
// w_i, see EQ(splat-composite), without those up to 1 / 1024; of equal ones the first.
// Pinholes, in the field's frame. The same for any number of threads. Colours are not looked
// at.
std::vector<int64_t> ByWhatIsShown(const RadianceField& field,
                                   const std::vector<Camera>& cameras);

}  // namespace regrade
