// A field in the colours in which one camera sees it.
#pragma once

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

// A field of degree 0 with the colours of vertices, see EQ(vertex-colors): for one frame of an
// adaptive field in a fifth of the memory. `camera` has no distortion. The geometry is shared.
// Cells near the camera, which it sees wide, are less exact.
RadianceField FieldSeenBy(const RadianceField& field, const Camera& camera);

}  // namespace regrade
