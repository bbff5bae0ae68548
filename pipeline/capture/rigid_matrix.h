// A rotation and a translation from the numbers of a pose file.
#pragma once

#include <optional>

#include "kernels/scene/camera.h"

namespace regrade {

// `rows` [3, 4]. The rotation is made orthonormal to double precision. Nothing if a value is
// not finite, or if the left part is further than rounding to a few digits from a rotation.
std::optional<RigidTransform> RigidFromRows(const double* rows);

}  // namespace regrade
