// The control of a run's table that bounds it from above: the closest that colours at the
// scene's voxels come to the 2D method's pictures.
#pragma once

#include <cstdint>
#include <vector>

#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"
#include "kernels/scene/camera.h"
#include "pipeline/fields/field_file.h"

namespace regrade {

inline constexpr char kCeilingControl[] = "control_ceiling";  // the row's name

// `styled` with its coefficients moved by least squares to `pictures`, one for each camera, of
// its size and of the capture's mean exposure; NaN is left out. See EQ(coefficient-fit): 30
// steps, at most 600000 rays of all views.
StoredField CeilingField(StoredField styled, const std::vector<Camera>& cameras,
                         const FrameSource& pictures, uint64_t seed,
                         const ProgressFunction& progress);

}  // namespace regrade
