// The splats of a large field that a page can do without least.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Marks `most` splats [splats]: those with the largest sums, over all pixels of the cameras, of
// w_i of EQ(splat-composite); of equal ones the first. Pinholes, in the field's frame. The same
// for any number of threads. Colours are not looked at.
std::vector<uint8_t> MostShown(const RadianceField& field, const std::vector<Camera>& cameras,
                               int64_t most);

}  // namespace regrade
