// Calls FFmpeg's libraries: libavformat finds the packets of the film, libavcodec decodes them,
// libswscale converts the frames.
#include "pipeline/images/film_decoder.h"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/log.h>
#include <libswscale/swscale.h>
}

#include "kernels/base/error.h"
#include "pipeline/images/color_profile.h"
#include "pipeline/images/ffmpeg_pointers.h"
#include "pipeline/images/film_frame.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {
namespace {

using namespace ffmpeg;  // NOLINT: owners of its objects

// Playlists, which name other files and hosts, are not among them.
constexpr char kContainers[] = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpegts,mpeg";
// Above, decoding every frame of a long film takes longer than what it adds.
constexpr int64_t kManyFrames = 1800;
constexpr int kMostFilmThreads = 8;  // each holds a frame
// A frame needs a few packets at most; more do not lead to any.
constexpr int64_t kTriesPerFrame = 16;

constexpr char kCopyOrConvert[] = "copy the file again from the camera, or convert it to MP4";

}  // namespace

struct FilmDecoder::State {
  std::string path;
  VideoLimits limits;
  VideoInfo info;
  int square_width = 0;  // of a stored frame with square pixels
  Input input;
  AVStream* stream = nullptr;
  Codec decoder;
  Scaler scaler;  // of the last conversion
  Packet packet{Allocated(av_packet_alloc())};
  Frame frame{Allocated(av_frame_alloc())};
  bool flushed = false;
  int64_t packets = 0, frames = 0, decoded_pixels = 0;
  double first = NAN;
  FrameInfo current;

  [[noreturn]] void Refuse(const std::string& why, const std::string& hint) const {
    throw InputError(why, path, hint);
  }
  void CheckOpen(int code, const char* step) const {
    if (code < 0)
      Refuse(std::string("cannot read this film: ") + step + ": " + ErrorText(code),
             kCopyOrConvert);
  }
  [[noreturn]] void RefuseLong() const {
    Refuse(Format("a film of more than %.0f minutes, %lld frames or %.0f gigapixels",
                  limits.max_seconds / 60, static_cast<long long>(limits.max_frames),
                  static_cast<double>(limits.max_decoded_pixels) / 1e9),
           "cut it to the part that shows the scene: one to three minutes are plenty");
  }

  void Open() {
    struct stat status;
    if (::stat(path.c_str(), &status) != 0) Refuse(std::strerror(errno), "");
    if (!S_ISREG(status.st_mode)) Refuse("not a regular file", "copy the film to a file");
    if (status.st_size == 0) Refuse("empty file", "copy it again from the camera");
    AVDictionary* options = nullptr;
    av_dict_set(&options, "format_whitelist", kContainers, 0);
    av_dict_set(&options, "protocol_whitelist", "file", 0);
    AVFormatContext* opened = nullptr;
    const int code = avformat_open_input(&opened, Url(path).c_str(), nullptr, &options);
    av_dict_free(&options);
    input.reset(opened);
    CheckOpen(code, "opening it");
    CheckOpen(avformat_find_stream_info(opened, nullptr), "its first frames");
    const AVCodec* codec = nullptr;
    const int index = av_find_best_stream(opened, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0);
    CheckOpen(index, "its pictures");
    stream = opened->streams[index];
    for (unsigned i = 0; i < opened->nb_streams; ++i)
      if (static_cast<int>(i) != index) opened->streams[i]->discard = AVDISCARD_ALL;
    Describe();
    OpenDecoder(codec);
  }

  void Describe() {
    const AVCodecParameters& parameters = *stream->codecpar;
    const int64_t width = parameters.width, height = parameters.height;
    if (width <= 0 || height <= 0) Refuse("no pixels", "");
    const AVRational aspect = av_guess_sample_aspect_ratio(input.get(), stream, nullptr);
    const double ratio = aspect.num > 0 && aspect.den > 0 ? av_q2d(aspect) : 1;
    const double square = ratio > 0.1 && ratio < 10 ? static_cast<double>(width) * ratio
                                                    : static_cast<double>(width);
    if (width > limits.max_pixels / height ||
        square * static_cast<double>(height) > static_cast<double>(limits.max_pixels))
      Refuse(Concat("frames of ", width, " x ", height, " pixels, more than the limit of ",
                    limits.max_pixels / 1'000'000, " megapixels"),
             "scale it down or raise max-megapixels by --config");
    square_width = static_cast<int>(std::lround(square));
    info.orientation = OrientationOf(*stream);
    const bool turned = info.orientation >= 5;
    info.width = turned ? static_cast<int>(height) : square_width;
    info.height = turned ? square_width : static_cast<int>(height);
    if (!IsSrgbLike(parameters.color_primaries, parameters.color_trc))
      info.colors = CicpName(parameters.color_primaries, parameters.color_trc);
    if (input->duration > 0) info.seconds = static_cast<double>(input->duration) / AV_TIME_BASE;
    if (stream->nb_frames > 0)
      info.frames = stream->nb_frames;
    else if (stream->avg_frame_rate.num > 0)
      info.frames = std::llround(std::min(info.seconds * av_q2d(stream->avg_frame_rate), 1e15));
    if (info.seconds > limits.max_seconds) RefuseLong();
  }

  void OpenDecoder(const AVCodec* codec) {
    decoder.reset(Allocated(avcodec_alloc_context3(codec)));
    CheckOpen(avcodec_parameters_to_context(decoder.get(), stream->codecpar), "its codec");
    decoder->pkt_timebase = stream->time_base;
    decoder->max_pixels = limits.max_pixels;
    decoder->err_recognition = AV_EF_EXPLODE;  // no frames with invented parts
    decoder->thread_count =
        std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMostFilmThreads);
    if (info.frames > kManyFrames && !limits.every_frame)
      decoder->skip_frame = AVDISCARD_NONREF;
    CheckOpen(avcodec_open2(decoder.get(), codec, nullptr), "its codec");
  }

  // Hands the decoder the next packet of the stream, or the end.
  void Feed() {
    for (;;) {
      const int code = av_read_frame(input.get(), packet.get());
      if (code < 0) {  // the end; a cut file ends where its bytes do
        if (code != AVERROR_EOF) ++current.damaged;
        flushed = true;
        avcodec_send_packet(decoder.get(), nullptr);
        return;
      }
      const bool ours = packet->stream_index == stream->index;
      if (ours && avcodec_send_packet(decoder.get(), packet.get()) < 0) ++current.damaged;
      av_packet_unref(packet.get());
      if (++packets > kTriesPerFrame * limits.max_frames) RefuseLong();
      if (ours) return;
    }
  }

  // True if the frame is whole and as the header said.
  bool IsUsable() const {
    return frame->decode_error_flags == 0 && (frame->flags & AV_FRAME_FLAG_CORRUPT) == 0 &&
           frame->width == stream->codecpar->width && frame->height == stream->codecpar->height;
  }

  void SetTime() {
    const int64_t stamp = frame->best_effort_timestamp;
    const double now =
        stamp == AV_NOPTS_VALUE ? NAN : static_cast<double>(stamp) * av_q2d(stream->time_base);
    if (std::isfinite(now)) {
      if (!std::isfinite(first)) first = now;
      current.seconds = std::max(current.seconds, now - first);
    } else if (frames > 1) {  // without times: evenly
      const AVRational rate = stream->avg_frame_rate;
      current.seconds += rate.num > 0 && rate.den > 0 ? 1 / av_q2d(rate) : 1 / 30.0;
    }
  }

  // The stored frame as interleaved values of one or two bytes.
  template <typename Value>
  Image Convert(int width, int height, AVPixelFormat format, int channels, int flags) {
    scaler.reset(sws_getCachedContext(scaler.release(), frame->width, frame->height,
                                      static_cast<AVPixelFormat>(frame->format), width, height,
                                      format, flags, nullptr, nullptr, nullptr));
    if (scaler == nullptr)
      Refuse("its pixels have a form that cannot be converted", kCopyOrConvert);
    // A film that does not name its matrix has BT.601's where it is small, else BT.709's.
    const bool unnamed =
        frame->colorspace == AVCOL_SPC_UNSPECIFIED || frame->colorspace == AVCOL_SPC_RGB;
    const int matrix = unnamed ? (frame->height < 720 ? SWS_CS_ITU601 : SWS_CS_ITU709)
                               : static_cast<int>(frame->colorspace);
    sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(matrix),
                             frame->color_range == AVCOL_RANGE_JPEG,
                             sws_getCoefficients(SWS_CS_ITU709), 1, 0, 1 << 16, 1 << 16);
    // Its fast paths fill rows up to a multiple of 64 bytes.
    const size_t stride = (width * channels * sizeof(Value) + 63) / 64 * 64;
    std::vector<uint8_t> bytes(stride * height + 64);
    uint8_t* const rows[] = {bytes.data()};
    const int strides[] = {static_cast<int>(stride)};
    sws_scale(scaler.get(), frame->data, frame->linesize, 0, frame->height, rows, strides);
    Image image(width, height, channels);
    float* to = image.pixels.data();
    for (int y = 0; y < height; ++y)
      for (int i = 0; i < width * channels; ++i) {
        Value value;
        std::memcpy(&value, &bytes[y * stride + i * sizeof(Value)], sizeof(Value));
        *to++ = static_cast<float>(value) / std::numeric_limits<Value>::max();
      }
    return image;
  }
};

FilmDecoder::FilmDecoder(const std::string& path, const VideoLimits& limits)
    : state_(std::make_unique<State>()) {
  av_log_set_level(AV_LOG_QUIET);  // errors come back as codes
  state_->path = path;
  state_->limits = limits;
  state_->Open();
}

FilmDecoder::~FilmDecoder() = default;

const VideoInfo& FilmDecoder::info() const { return state_->info; }
const FrameInfo& FilmDecoder::frame() const { return state_->current; }

bool FilmDecoder::Next() {
  State& s = *state_;
  for (;;) {
    const int code = avcodec_receive_frame(s.decoder.get(), s.frame.get());
    if (code == AVERROR_EOF || (code == AVERROR(EAGAIN) && s.flushed)) {
      if (s.frames == 0) s.Refuse("no frame of this film can be decoded", kCopyOrConvert);
      return false;
    }
    if (code == AVERROR(EAGAIN)) {
      s.Feed();
      continue;
    }
    if (code < 0 || !s.IsUsable()) {
      if (++s.current.damaged > kTriesPerFrame * s.limits.max_frames) s.RefuseLong();
      continue;
    }
    ++s.frames;
    s.decoded_pixels += static_cast<int64_t>(s.frame->width) * s.frame->height;
    s.SetTime();
    if (KeepOneField(s.frame.get())) ++s.current.interlaced;
    if (s.frames > s.limits.max_frames || s.decoded_pixels > s.limits.max_decoded_pixels ||
        s.current.seconds > s.limits.max_seconds)
      s.RefuseLong();
    return true;
  }
}

Image FilmDecoder::Picture() {
  State& s = *state_;
  constexpr int kExact =
      SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP;
  const int width = s.square_width, height = s.frame->height;
  StoredPicture picture;
  picture.primaries = s.frame->color_primaries;
  picture.transfer = s.frame->color_trc;
  picture.image = IsSrgbLike(picture.primaries, picture.transfer)
                      ? s.Convert<uint8_t>(width, height, AV_PIX_FMT_RGB24, 3, kExact)
                      : s.Convert<uint16_t>(width, height, AV_PIX_FMT_RGB48, 3, kExact);
  picture.orientation = s.info.orientation;
  ApplyPhotoRules(&picture, s.path);
  return std::move(picture.image);
}

Image FilmDecoder::Grey(int longer_side) {
  State& s = *state_;
  const int w = s.square_width, h = s.frame->height;
  const double scale = std::min(1.0, static_cast<double>(longer_side) / std::max(w, h));
  const auto side = [scale](int full) {
    return std::max(1, static_cast<int>(std::lround(full * scale)));
  };
  const Image grey = s.Convert<uint8_t>(side(w), side(h), AV_PIX_FMT_GRAY8, 1, SWS_AREA);
  return Upright(grey, s.info.orientation);
}

}  // namespace regrade
