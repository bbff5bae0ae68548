// Writes the films of a run while frames are rendered: the restyled scene, a wipe between
// before and after, and the 2D method frame by frame.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/workspace/output_names.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// `left` up to column `border`, and `right` from there on.
Image Wipe(const Image& left, const Image& right, int border);

class RunFilms {
 public:
  // `frames`: their number, at most one for each camera of the film's path.
  RunFilms(const Workspace& workspace, double frames_per_second, int frames);

  // Frame `index` of each film; `views_2d` is null for all frames or for none. All frames have
  // one size. Without an H.264 encoder there are no films: see why_none.
  void Add(int index, const Image& source, const Image& styled, const Image* views_2d);
  // Completes the films and adds their names to `outputs`.
  void Finish(std::vector<std::string>* outputs);

  // Empty, or the reason why there are no films.
  const std::string& why_none() const { return why_none_; }

 private:
  void Begin(const Image& first, bool with_views_2d);
  void GiveUp(const std::string& why);

  const Workspace& workspace_;
  double frames_per_second_;
  int frames_;
  int width_ = 0, height_ = 0;
  std::optional<VideoWriter> film_, wipe_, frame_by_frame_;
  std::string why_none_;
};

}  // namespace regrade
