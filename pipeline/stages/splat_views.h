// Stage "pose" of a run that was given splats without photos: pictures of the splats take the
// photos' places.
#pragma once

#include "pipeline/run/run_context.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

// Whether --cameras names a capture with photos. Throws Error(kInput) if it names neither
// photos with poses nor cameras.
bool HasPhotosOfSplats(const RunContext& context);

// Of the pictures that stand for photos, before they are made.
CaptureSize SizeOfSplatViews(const RunContext& context);

// Renders the file of splats at the cameras of --cameras, or without it at views that are
// placed by measurement, and writes them as poses/.
Stage SplatViewsStage(RunContext* context);

}  // namespace regrade
