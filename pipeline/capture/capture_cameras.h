// The cameras of a capture, with photos or without.
#pragma once

#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/capture/capture_source.h"

namespace regrade {

// Throws Error(kInput) with `path` if `source` is photos without poses.
void RequireCameras(const CaptureSource& source, const std::string& path);

// Of all that ReadBareCameras reads, and of photos with poses in any layout of CaptureKind, as
// pinholes of the photos' sizes, in natural order of the photos' names. Photos are decoded
// where sizes of cameras follow from them. Throws Error(kInput), Interrupted.
std::vector<BareCamera> CamerasOfCapture(const std::string& path,
                                         const ProgressFunction& progress);

}  // namespace regrade
