// The exposures of frames at the photos' places: with --keep-exposure those of the photos. What
// such frames are compared with needs the same ones.
#pragma once

#include <vector>

#include "evaluate/frame_source.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// Of the frames at the places of the photos `of`, in their order; none where frames have the
// capture's mean exposure.
PhotoGains FrameGains(const WorkingViews& views, const RenderOptions& options,
                      const std::vector<int>& of);

// Frames k of mean exposure as a camera of gain k shows them. NaN stays NaN.
FrameSource PutGains(const FrameSource& frames, const PhotoGains& gains);

// The inverse. Values that a gain above 1 has clipped become the darkest ones that it clips.
FrameSource UndoGains(const FrameSource& frames, const PhotoGains& gains);

}  // namespace regrade
