// The gains that photos are rid of before anything looks at them, and where stages read them.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace/workspace.h"
#include "reconstruct/refinement/exposure.h"

namespace regrade {

// What a camera's exposure and white balance made of one photo.
struct PhotoGain {
  Vec3d light{1, 1, 1};  // its linear light is this times that of the capture's mean photo
  // What is clipped was this bright at least. How much of the way from there to white it is
  // shown, in [0, 1]: the share of what bright photos clip that is clipped in dark ones, too.
  double highlights = 0;

  bool operator==(const PhotoGain&) const = default;
};

// A photo is left as it was taken, bit for bit.
inline const PhotoGain kAsTaken{};

// One for each view of the capture, or none at all where exposure is off.
struct PhotoGains {
  std::vector<PhotoGain> of_view;

  PhotoGain Of(int view) const {
    return of_view.empty() ? kAsTaken : of_view[static_cast<size_t>(view)];
  }
};

// `clipped`: for each view the share of its pixels that are clipped, by channel.
PhotoGains GainsOf(const ExposureEstimate& estimate, const std::vector<Vec3d>& clipped);

// The photo as the capture's mean exposure would show it: linear values over gain, clipped to
// [0, 1].
void UndoGain(const PhotoGain& gain, Image* photo);
// The other way: what a camera of that gain would make of a render.
void PutGain(const PhotoGain& gain, Image* picture);

// For the record of stage "reconstruct", one row a photo.
JsonValue GainsRecord(const Capture& capture, const ExposureEstimate& estimate,
                      const PhotoGains& gains);
// The record's rows as they stand, an input of stages that read photos; null where exposure is
// off.
JsonValue RecordedGainRows(const Workspace& workspace);
// The gains that the field was fitted with. Throws Error(kInput) where they are not this
// capture's.
PhotoGains RecordedGains(const Workspace& workspace, const Capture& capture);

}  // namespace regrade
