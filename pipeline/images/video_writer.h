// Writes frames as an H.264 MP4 file that plays in browsers.
#pragma once

#include <memory>
#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// x264's constant rate factor: 0 is lossless, 51 the worst; at 18 most people see no loss.
inline constexpr int kVideoCrf = 18;

// A film is encoded in groups of so many frames, each by an encoder of its own: the bytes of a
// group depend on its frames alone, and players jump to its first one.
inline constexpr int kFilmGroup = 48;

// Frames go to a temporary beside `path`; `path` appears only with Finish(). A writer that is
// destroyed before leaves nothing. Colours are 4:2:0 with BT.709's matrix, and the file is
// marked so; its index comes first. H.264 needs even sizes: the last column or row is repeated
// where the frames have odd ones. Equal frames give equal bytes.
class VideoWriter {
 public:
  // Throws Error(kExternalProgram) if FFmpeg here has no H.264 encoder, Error(kResources) if
  // the file cannot be created.
  VideoWriter(const std::string& path, int width, int height, double frames_per_second);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  // A frame of the given size, 1, 3 or 4 channels (alpha is laid over white), sRGB. Throws
  // Error(kResources) if the disk does not take it.
  void Add(const Image& frame);

  // Completes the file, makes it durable, decodes it to count its frames, and puts it in place.
  // Throws Error(kResources) if a write failed or the count is wrong.
  void Finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace regrade
