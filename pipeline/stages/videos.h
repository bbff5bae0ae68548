// The films of a run, written as their frames come: the restyled scene, the wipe between before
// and after, and the 2D method frame by frame.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

class RunFilms {
 public:
  // `frames`: how many will come, at most one for each camera of the film's way.
  RunFilms(const Workspace& workspace, double frames_per_second, int frames);

  // Frame `index` of each; `views_2d` may be null, for all frames or for none. A machine
  // without H.264 makes no films: see why_none. All frames have one size.
  void Add(int index, const Image& source, const Image& styled, const Image* views_2d);
  // Puts the films in place and adds their names to `outputs`.
  void Finish(std::vector<std::string>* outputs);

  // Empty, or why there are no films, to be told to the user.
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
