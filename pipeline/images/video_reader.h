// Reads the frames of a film one after the other, upright and with their times.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "kernels/scene/image.h"

namespace regrade {

// What a film may cost; a file that needs more is refused.
struct VideoLimits {
  int64_t max_pixels = 128'000'000;              // of a frame
  double max_seconds = 1200;                     // by its header and by its frames' times
  int64_t max_frames = 72'000;                   // decoded: 20 minutes of 60 a second
  int64_t max_decoded_pixels = 300'000'000'000;  // of all frames: 10 minutes of 4K at 60 a s
  bool every_frame = false;                      // passes over none of a long film
};

// What the header says.
struct VideoInfo {
  int width = 0, height = 0;  // of a frame, upright, with square pixels
  double seconds = 0;         // 0: unknown
  int64_t frames = 0;         // about; 0: unknown
  int turn = 0;        // degrees clockwise that bring a stored frame upright: 0, 90, 180, 270
  std::string colors;  // other than those of sRGB, which are converted: "BT.2020, HLG"
};

// MP4, QuickTime, Matroska, WebM, AVI, MPEG transport and program streams, with any codec of
// FFmpeg's. Reads the file alone: no playlist and no reference to other files or hosts. In
// memory: one frame, and those that the decoder refers to. Of films of more than 1800 frames,
// frames that no other depends on may be passed over; the same file gives the same frames each
// time. Frames that cannot be decoded whole are passed over and counted.
class VideoReader {
 public:
  // Throws Error(kInput) with the file's name for what is not a film, is too long or too large.
  explicit VideoReader(const std::string& path, const VideoLimits& limits = {});
  ~VideoReader();
  VideoReader(const VideoReader&) = delete;
  VideoReader& operator=(const VideoReader&) = delete;

  const VideoInfo& info() const;

  // Decodes the next frame; false at the end. Throws Error(kInput) beyond the limits, and at
  // the end of a film of which no frame could be decoded.
  bool Next();

  // Of the current frame:
  double seconds() const;       // since the first; never decreases
  Image Picture();              // RGB, sRGB in [0, 1]
  Image Grey(int longer_side);  // 1 channel, scaled down to this size in pixels

  int64_t damaged() const;  // frames and packets so far that could not be decoded

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Number of frames that decode, or -1 if the file cannot be opened as a film.
int CountVideoFrames(const std::string& path);

}  // namespace regrade
