// Calls FFmpeg's libavformat: packets are copied from MP4 to MP4, with later times.
#include "pipeline/images/joined_film.h"

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <limits>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/log.h>
}

#include "kernels/base/error.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/ffmpeg_pointers.h"
#include "pipeline/images/video_reader.h"

namespace regrade {
namespace {

using namespace ffmpeg;  // NOLINT: owners of its objects

[[noreturn]] void RefusePart(const std::string& why, const std::string& path) {
  throw InputError("this part of a film " + why, path,
                   "remove its folder, and render the part again");
}

// A run's folder may come from a stranger: nothing but an MP4 file is read.
Input OpenPart(const std::string& path) {
  AVDictionary* options = nullptr;
  av_dict_set(&options, "format_whitelist", "mov,mp4,m4a,3gp,3g2,mj2", 0);
  av_dict_set(&options, "protocol_whitelist", "file", 0);
  AVFormatContext* opened = nullptr;
  int code = avformat_open_input(&opened, Url(path).c_str(), nullptr, &options);
  av_dict_free(&options);
  Input input(opened);
  if (code >= 0) code = avformat_find_stream_info(input.get(), nullptr);
  if (code < 0) RefusePart("cannot be read: " + ErrorText(code), path);
  if (input->nb_streams != 1 || input->streams[0]->codecpar->codec_id != AV_CODEC_ID_H264)
    RefusePart("is not one stream of H.264", path);
  return input;
}

// Frames of one can follow those of the other.
bool EncodedAlike(const AVStream& a, const AVStream& b) {
  const AVCodecParameters &p = *a.codecpar, &q = *b.codecpar;
  return p.width == q.width && p.height == q.height && p.extradata_size == q.extradata_size &&
         std::equal(p.extradata, p.extradata + p.extradata_size, q.extradata) &&
         av_cmp_q(a.avg_frame_rate, b.avg_frame_rate) == 0;
}

// The film under construction.
struct JoinedFilm {
  std::string path, temporary;
  Output output;
  AVStream* stream = nullptr;
  AVRational frame{};  // its time
  int64_t frames = 0;  // so far
  Packet packet{Allocated(av_packet_alloc())};

  ~JoinedFilm() {
    output.reset();
    if (!temporary.empty()) ::unlink(temporary.c_str());
  }

  void Check(int code) const {
    if (code >= 0 && output->pb != nullptr) code = output->pb->error;
    if (code < 0)
      throw ResourceError("cannot write the video: " + ErrorText(code), path,
                          "free some space, then run the same command again");
  }

  void Open(const AVStream& first) {
    AVFormatContext* made = nullptr;
    const int code =
        avformat_alloc_output_context2(&made, nullptr, "mp4", Url(temporary).c_str());
    output.reset(made);
    Check(code);
    output->flags |= AVFMT_FLAG_BITEXACT;  // no dates, no version
    stream = Allocated(avformat_new_stream(output.get(), nullptr));
    Check(avcodec_parameters_copy(stream->codecpar, first.codecpar));
    stream->codecpar->codec_tag = 0;
    stream->codecpar->bit_rate = 0;  // of the first part: the muxer counts that of the whole
    frame = av_inv_q(first.avg_frame_rate);
    stream->time_base = frame;
    stream->avg_frame_rate = first.avg_frame_rate;
    Check(avio_open(&output->pb, Url(temporary).c_str(), AVIO_FLAG_WRITE));
    AVDictionary* options = nullptr;
    av_dict_set(&options, "movflags", "+faststart", 0);
    const int written = avformat_write_header(output.get(), &options);
    av_dict_free(&options);
    Check(written);
  }

  void Add(const FilmPart& part) {
    const Input input = OpenPart(part.path);
    const AVStream& from = *input->streams[0];
    if (stream == nullptr) Open(from);
    if (!EncodedAlike(from, *stream)) RefusePart("is not encoded as the first one", part.path);
    int64_t added = 0, last = std::numeric_limits<int64_t>::min();
    while (av_read_frame(input.get(), packet.get()) >= 0) {
      av_packet_rescale_ts(packet.get(), from.time_base, frame);
      if (packet->dts <= last || packet->pts < 0 || packet->pts >= part.frames)
        RefusePart("has frames at wrong times", part.path);
      last = packet->dts;
      packet->pts += frames;
      packet->dts += frames;
      packet->duration = 1;
      packet->pos = -1;
      packet->stream_index = 0;
      av_packet_rescale_ts(packet.get(), frame, stream->time_base);
      Check(av_interleaved_write_frame(output.get(), packet.get()));
      ++added;
    }
    if (added != part.frames)
      RefusePart(Concat("has ", added, " of ", part.frames, " frames"), part.path);
    frames += added;
  }

  void Finish() {
    Check(av_write_trailer(output.get()));
    avio_flush(output->pb);
    Check(0);
    Check(avio_closep(&output->pb));
    SyncFile(temporary);
    if (const int readable = CountVideoFrames(temporary); readable != frames)
      throw ResourceError(
          Concat(readable, " of ", frames, " frames of the video can be read back"), path,
          "check the disk, then run the same command again");
    RenameDurably(temporary, path);
    temporary.clear();
  }
};

}  // namespace

void JoinFilms(const std::vector<FilmPart>& parts, const std::string& path) {
  REGRADE_CHECK(!parts.empty());
  av_log_set_level(AV_LOG_QUIET);  // errors come back as codes
  JoinedFilm film;
  film.path = path;
  film.temporary = path + kTemporarySuffix;
  for (const FilmPart& part : parts) film.Add(part);
  film.Finish();
}

}  // namespace regrade
