// Reads the frames of a film one after the other, upright and with their times.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "kernels/scene/image.h"
#include "pipeline/images/film_source.h"

namespace regrade {

// MP4, QuickTime, Matroska, WebM, AVI, MPEG transport and program streams, with any codec of
// FFmpeg's. Reads the file alone: no playlist and no reference to other files or hosts. In
// memory: one frame, and those that the decoder refers to. Of films of more than 1800 frames,
// frames that no other depends on may be passed over; the same file gives the same frames each
// time. Frames that cannot be decoded whole are passed over and counted. Of interlaced frames,
// the rows of the first moment are kept and the others interpolated between them. Decodes in
// a child process where decoder_process.h says so.
class VideoReader {
 public:
  // Throws Error(kInput) with the file's name for what is not a film, is too long or too large.
  explicit VideoReader(const std::string& path, const VideoLimits& limits = {});

  const VideoInfo& info() const { return source_->info(); }

  // Decodes the next frame; false at the end. Throws Error(kInput) beyond the limits, at the
  // end of a film of which no frame could be decoded, and for one that ends its decoder.
  bool Next() { return source_->Next(); }

  // Of the current frame:
  double seconds() const { return source_->frame().seconds; }  // since the first
  Image Picture() { return source_->Picture(); }               // RGB, sRGB in [0, 1]
  // 1 channel, scaled down to this size in pixels.
  Image Grey(int longer_side) { return source_->Grey(longer_side); }

  int64_t damaged() const { return source_->frame().damaged; }
  int64_t interlaced() const { return source_->frame().interlaced; }

 private:
  std::unique_ptr<FilmSource> source_;
};

// Number of frames of a film of ours that decode, or -1 if it cannot be opened.
int CountVideoFrames(const std::string& path);

}  // namespace regrade
