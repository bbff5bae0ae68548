// Writes a run's frames and films while the next frames are rendered.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/program/ordered_worker.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/photo_vignette.h"
#include "pipeline/stages/videos.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// frames/names.json: {"00000.png": "IMG_1.jpg", ...}, the photo at whose place each frame is;
// of frames/source, styled, views_2d, and the same with one camera.
void WriteFrameNames(const WorkingViews& views, const Workspace& workspace);

// The frames of one camera.
struct Frame {
  Image source, styled, transmittance;
  Image depth;                    // of the source
  std::optional<Image> views_2d;  // of methods that can style a render
  Image edited;                   // where views_2d has an edit, see CarriedEdit; or empty
};

// A thread for each sequence of pictures and one for the films, so that a GPU does not wait for
// them. Errors of the threads are thrown by Write or Finish.
class FrameWriter {
 public:
  FrameWriter(std::string folder, const Vignette& vignette, RunFilms* films)
      : folder_(std::move(folder)), vignette_(vignette), films_(films) {}

  // FOLDER/frames/<prefix>{source, styled, views_2d, transmittance, edited}/<index>.png
  void Write(const std::shared_ptr<const Frame>& frame, const FrameSet& set, int index);
  void Finish();

 private:
  // As films show it.
  Image Shown(Image picture) const {
    PutVignette(vignette_, &picture);
    return picture;
  }

  const std::string folder_;
  const Vignette vignette_;
  RunFilms* films_;
  OrderedWorker source_, styled_, views_2d_, grey_, film_;
};

}  // namespace regrade
