// Calls FFmpeg's libavformat.
#include "pipeline/images/mp4_file.h"

#include <unistd.h>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/video_reader.h"

namespace regrade {

using namespace ffmpeg;  // NOLINT: owners of its objects

Mp4File::Mp4File(const std::string& path) : path_(path), temporary_(path + kTemporarySuffix) {
  AVFormatContext* output = nullptr;
  // The muxer opens the file by this name again to move the index to the front.
  const int code =
      avformat_alloc_output_context2(&output, nullptr, "mp4", Url(temporary_).c_str());
  output_.reset(output);
  Check(code);
  output_->flags |= AVFMT_FLAG_BITEXACT;
}

Mp4File::~Mp4File() {
  output_.reset();
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void Mp4File::Check(int code) const {
  if (code >= 0 && output_->pb != nullptr) code = output_->pb->error;
  if (code < 0)
    throw ResourceError("cannot write the video: " + ErrorText(code), path_,
                        "free some space, then run the same command again");
}

bool Mp4File::WantsGlobalHeader() const {
  return (output_->oformat->flags & AVFMT_GLOBALHEADER) != 0;
}

void Mp4File::Begin(const AVCodecParameters& parameters, const AVRational& frame) {
  frame_num_ = frame.num, frame_den_ = frame.den;
  stream_ = Allocated(avformat_new_stream(output_.get(), nullptr));
  Check(avcodec_parameters_copy(stream_->codecpar, &parameters));
  // Those of a film that is read: the muxer has its own tag, and counts the rate of the whole.
  stream_->codecpar->codec_tag = 0;
  stream_->codecpar->bit_rate = 0;
  stream_->time_base = frame;
  stream_->avg_frame_rate = av_inv_q(frame);
  Check(avio_open(&output_->pb, Url(temporary_).c_str(), AVIO_FLAG_WRITE));
  AVDictionary* options = nullptr;
  av_dict_set(&options, "movflags", "+faststart", 0);
  const int code = avformat_write_header(output_.get(), &options);
  av_dict_free(&options);
  Check(code);
}

void Mp4File::Write(AVPacket* packet) {
  packet->duration = 1;
  packet->pos = -1;
  packet->stream_index = 0;
  av_packet_rescale_ts(packet, {frame_num_, frame_den_}, stream_->time_base);
  Check(av_interleaved_write_frame(output_.get(), packet));
}

void Mp4File::Finish(int64_t frames) {
  Check(av_write_trailer(output_.get()));
  avio_flush(output_->pb);
  Check(0);
  Check(avio_closep(&output_->pb));
  SyncFile(temporary_);
  if (const int readable = CountVideoFrames(temporary_); readable != frames)
    throw ResourceError(
        Concat(readable, " of ", frames, " frames of the video can be read back"), path_,
        "check the disk, then run the same command again");
  RenameDurably(temporary_, path_);
  temporary_.clear();
}

}  // namespace regrade
