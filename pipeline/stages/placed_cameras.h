// Cameras of splats that come without: views that are placed by measurement.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/splats/splats.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/program/console.h"

namespace regrade {

// See PlaceViews; in an order without jumps. `field` is made of `splats`, `up` is a value of
// --up, `longest` the longer side in pixels. Tells the console what was decided.
std::vector<BareCamera> PlacedCameras(const Splats& splats, const RadianceField& field,
                                      Backend backend, const std::string& up, int longest,
                                      const std::string& where, Console* console,
                                      const ProgressFunction& progress);

// The camera for pictures whose longer side has at most `longest` pixels.
Camera ReducedTo(double longest, const Camera& camera);

}  // namespace regrade
