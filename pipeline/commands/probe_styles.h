// Looks at what styles are made from before long work starts.
#pragma once

#include "pipeline/program/console.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// Makes the paths of the style pictures absolute and reads each; checks 2D method and masks.
// A network that the program knows by name is fetched after a yes. Throws Error(kUsage) where
// there is no picture, and Error(kInput).
void ProbeStyles(RunSettings* settings, Console* console, bool measured = true);

// One of them: a picture that can be read, or a LUT and what goes with it. Throws Error(kUsage,
// kInput).
void CheckStyle(const std::string& path, const RunSettings& settings);

}  // namespace regrade
