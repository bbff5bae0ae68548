// What the photos of a run need, by its settings.
#pragma once

#include <string>

#include "pipeline/capture/scene_profile.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// ProfileScene for the run's kind of field. `overrides`: effects over those of the settings.
SceneProfile ProfileRun(const RunSettings& settings, const Capture& capture,
                        const std::string& overrides = "");

// Without exposures, which neither frame nor box depend on: it reads no photo.
NormalizedScene SceneOfRun(const RunSettings& settings, const Capture& capture);

}  // namespace regrade
