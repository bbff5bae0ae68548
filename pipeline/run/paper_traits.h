// What the choice of the paper's configuration depends on, measured.
#pragma once

#include "kernels/scene/capture.h"
#include "pipeline/run/paper_config.h"

namespace regrade {

// Reads the photos' transparency.
PaperTraits TraitsOf(const Capture& capture);

}  // namespace regrade
