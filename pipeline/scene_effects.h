// What the scene calls for, decided from what was measured of its capture.
#pragma once

#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/report_data.h"

namespace regrade {

// One row for each effect that this version decides. "distortion": the lens is followed where
// it moves a picture's corner by more than kDistortionThreshold (scene_views.h).
// "view-dependence": colours change with the direction, as `sh_degree` was set.
std::vector<EffectReport> EffectsOf(const Capture& capture, int sh_degree);

// "distortion on: 12.3 > 0.5 (pixels, ...)"
std::string EffectLine(const EffectReport& effect);

}  // namespace regrade
