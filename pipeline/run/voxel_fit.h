// The fit of a field of voxels.
#pragma once

#include "pipeline/run/fit_kind.h"

namespace regrade {

extern const FitKind kVoxelFit;

}  // namespace regrade
