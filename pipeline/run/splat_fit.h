// The fit of a field of splats.
#pragma once

#include "pipeline/run/fit_kind.h"

namespace regrade {

extern const FitKind kSplatFit;

}  // namespace regrade
