// The gains that photos are rid of before anything looks at them, and where stages read them.
#pragma once

#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/files/json_file.h"
#include "pipeline/workspace.h"
#include "reconstruct/exposure.h"

namespace regrade {

// A gain that leaves a photo as it was taken, bit for bit.
inline constexpr Vec3d kAsTaken{1, 1, 1};

// One gain of linear light for each view of the capture, or none at all where exposure is off.
struct PhotoGains {
  std::vector<Vec3d> of_view;

  Vec3d Of(int view) const {
    return of_view.empty() ? kAsTaken : of_view[static_cast<size_t>(view)];
  }
};

// The photo as the capture's mean exposure would show it: linear values over gain, clipped to
// [0, 1].
void UndoGain(const Vec3d& gain, Image* photo);

// For the record of stage "reconstruct", one row a photo.
JsonValue GainsRecord(const Capture& capture, const ExposureEstimate& estimate);
// The record's rows as they stand, an input of stages that read photos; null where exposure is
// off.
JsonValue RecordedGainRows(const Workspace& workspace);
// The gains that the field was fitted with. Throws Error(kInput) where they are not this
// capture's.
PhotoGains RecordedGains(const Workspace& workspace, const Capture& capture);

}  // namespace regrade
