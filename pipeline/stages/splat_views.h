// Stage "pose" of a run that was given splats without photos: pictures of the splats take the
// photos' places; and cameras for splats that have none.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/splats/splats.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/program/console.h"
#include "pipeline/run/run_context.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {

// Of splats that come without cameras: see PlaceViews; in an order without jumps. `field` is
// made of `splats`, `up` is a value of
// --up, `longest` the longer side in pixels. Tells the console what was decided.
std::vector<BareCamera> PlacedCameras(const Splats& splats, const RadianceField& field,
                                      Backend backend, const std::string& up, int longest,
                                      const std::string& where, Console* console,
                                      const ProgressFunction& progress);

// The camera for pictures whose longer side has at most `longest` pixels.
Camera ReducedTo(double longest, const Camera& camera);

// Whether --cameras names a capture with photos. Throws Error(kInput) if it names neither
// photos with poses nor cameras.
bool HasPhotosOfSplats(const RunContext& context);

// Of the pictures that stand for photos, before they are made.
CaptureSize SizeOfSplatViews(const RunContext& context);

// Renders the file of splats at the cameras of --cameras, or without it at views that are
// placed by measurement, and writes them as poses/.
Stage SplatViewsStage(RunContext* context);

}  // namespace regrade
