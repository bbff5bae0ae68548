// What no static field can beat: the least squares of all voxels' coefficients to pictures.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade::testing {

// Pictures of a field from all cameras.
std::vector<Image> RendersOf(const RadianceField& field, const std::vector<Camera>& cameras);

// `field`, of nine harmonics a channel, whose coefficients are moved by least squares towards
// what its renders lack to pictures, `missing` [views] of [H, W, 3], by conjugate gradients;
// clamps aside. With `harmonics` 1 it is one colour that is added to each voxel. Geometry, and
// what rays see beyond the box, stay.
RadianceField FieldCeiling(RadianceField field, const std::vector<Camera>& cameras,
                           const std::vector<Image>& missing, int harmonics = 9);

}  // namespace regrade::testing
