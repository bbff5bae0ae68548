// Writes frames as an H.264 MP4 file that plays in browsers.
#pragma once

#include <memory>
#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// Frames go to a temporary beside `path`; `path` itself appears, whole, only with Finish().
// A writer that is destroyed before leaves nothing. H.264 needs even sizes: the last column or
// row is repeated where the frames have odd ones.
class VideoWriter {
 public:
  // Throws Error(kExternalProgram) if OpenCV here cannot write H.264, Error(kResources) if the
  // folder cannot be written.
  VideoWriter(const std::string& path, int width, int height, double frames_per_second);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  // A frame of the size announced, 1, 3 or 4 channels (alpha is laid over white), sRGB.
  void Add(const Image& frame);

  // Moves the index to the front, puts the file in place, opens it again and counts its frames.
  // Throws Error(kResources) if the file is not whole.
  void Finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Frames that decode, or -1 if the file cannot be opened as a video.
int CountVideoFrames(const std::string& path);

}  // namespace regrade
