// An MP4 file under construction, for the files that encode or join films.
#pragma once

#include <cstdint>
#include <string>

#include "pipeline/images/ffmpeg_pointers.h"

struct AVCodecParameters;
struct AVRational;
struct AVStream;

namespace regrade {

// Bytes go to a temporary beside `path`, which appears only with Finish(); without it nothing
// is left. One stream; the index comes first, and no date or version is written.
class Mp4File {
 public:
  explicit Mp4File(const std::string& path);
  ~Mp4File();
  Mp4File(const Mp4File&) = delete;
  Mp4File& operator=(const Mp4File&) = delete;

  // Describes the stream, whose frames last `frame` seconds each, and writes the header.
  void Begin(const AVCodecParameters& parameters, const AVRational& frame);
  // A packet with times in frames. Throws Error(kResources) if the disk does not take it.
  void Write(AVPacket* packet);
  // Completes the file, makes it durable, decodes it to count its frames, and puts it in place.
  // Throws Error(kResources) if a write failed or the count is wrong.
  void Finish(int64_t frames);

  // Does the format want the codec's headers in front, AVFMT_GLOBALHEADER?
  bool WantsGlobalHeader() const;
  // Null before Begin.
  const AVStream* stream() const { return stream_; }

 private:
  void Check(int code) const;

  std::string path_, temporary_;
  ffmpeg::Output output_;
  AVStream* stream_ = nullptr;
  int frame_num_ = 0, frame_den_ = 1;
};

}  // namespace regrade
