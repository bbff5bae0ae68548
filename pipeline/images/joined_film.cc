// Calls FFmpeg's libavformat: packets are copied from MP4 to MP4, with later times.
#include "pipeline/images/joined_film.h"

#include <algorithm>
#include <cstdint>
#include <limits>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/log.h>
}

#include "kernels/base/error.h"
#include "pipeline/images/ffmpeg_pointers.h"
#include "pipeline/images/mp4_file.h"

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

// Adds the part's packets behind `before` frames.
void Append(const FilmPart& part, int64_t before, Mp4File* film) {
  const Input input = OpenPart(part.path);
  const AVStream& from = *input->streams[0];
  const AVRational frame = av_inv_q(from.avg_frame_rate);
  if (film->stream() == nullptr) film->Begin(*from.codecpar, frame);
  if (!EncodedAlike(from, *film->stream()))
    RefusePart("is not encoded as the first one", part.path);
  const Packet packet{Allocated(av_packet_alloc())};
  int64_t added = 0, last = std::numeric_limits<int64_t>::min();
  for (; av_read_frame(input.get(), packet.get()) >= 0; ++added) {
    av_packet_rescale_ts(packet.get(), from.time_base, frame);
    if (packet->dts <= last || packet->pts < 0 || packet->pts >= part.frames)
      RefusePart("has frames at wrong times", part.path);
    last = packet->dts;
    packet->pts += before;
    packet->dts += before;
    film->Write(packet.get());
  }
  if (added != part.frames)
    RefusePart(Concat("has ", added, " of ", part.frames, " frames"), part.path);
}

}  // namespace

void JoinFilms(const std::vector<FilmPart>& parts, const std::string& path) {
  REGRADE_CHECK(!parts.empty());
  av_log_set_level(AV_LOG_QUIET);  // errors come back as codes
  Mp4File film(path);
  int64_t frames = 0;
  for (const FilmPart& part : parts) {
    Append(part, frames, &film);
    frames += part.frames;
  }
  film.Finish(frames);
}

}  // namespace regrade
