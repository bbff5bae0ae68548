// What a film needs to be read: implemented in this process (film_decoder.h) and by one that
// runs in another (decoder_process.h).
#pragma once

#include <cstdint>
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
  int orientation = 1;  // as EXIF counts: how a stored frame is turned and mirrored to be seen
  std::string colors;   // other than those of sRGB, which are converted: "BT.2020, HLG"
};

// Of the current frame, and of those so far.
struct FrameInfo {
  double seconds = 0;      // since the first; never decreases
  int64_t damaged = 0;     // frames and packets so far that could not be decoded
  int64_t interlaced = 0;  // frames so far that show two moments, of which one was kept
};

// See VideoReader (video_reader.h).
class FilmSource {
 public:
  virtual ~FilmSource() = default;
  virtual const VideoInfo& info() const = 0;
  virtual bool Next() = 0;
  virtual const FrameInfo& frame() const = 0;
  virtual Image Picture() = 0;
  virtual Image Grey(int longer_side) = 0;
};

}  // namespace regrade
