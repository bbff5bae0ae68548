// Writes the films of a run while frames are rendered: the restyled scene, a wipe between
// before and after, and the 2D method frame by frame.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/image.h"
#include "pipeline/images/video_writer.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {

// `left` up to column `border`, and `right` from there on.
Image Wipe(const Image& left, const Image& right, int border);

class RunFilms {
 public:
  // Films are written to `folder`. `frames`: their number, at most one for each camera of the
  // film's path. The film of the 2D method has its own rate.
  RunFilms(std::string folder, double frames_per_second, int frames,
           double views_2d_per_second);

  // Frame `index` of the film and the wipe; all have one size. Without an H.264 encoder there
  // are no films: see why_none.
  void Add(int index, const Image& source, const Image& styled);
  // The next frame of the 2D method's film.
  void AddViews2d(const Image& views_2d);
  // Completes the films and adds their names to `outputs`.
  void Finish(std::vector<std::string>* outputs);

  // Empty, or the reason why there are no films.
  const std::string& why_none() const { return why_none_; }

 private:
  void Open(const char* name, const Image& first, double frames_per_second,
            std::optional<VideoWriter>* writer);
  void GiveUp(const std::string& why);

  const std::string folder_;
  double frames_per_second_, views_2d_per_second_;
  int frames_;
  std::optional<VideoWriter> film_, wipe_, frame_by_frame_;
  std::string why_none_;
};

}  // namespace regrade
