// Calls FFmpeg's libraries: libswscale converts the frames, libavcodec (libx264) encodes them.
#include "pipeline/images/video_writer.h"

#include <algorithm>
#include <cstdint>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavutil/cpu.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include "kernels/base/error.h"
#include "pipeline/images/ffmpeg_pointers.h"
#include "pipeline/images/mp4_file.h"
#include "pipeline/images/normalize_photo.h"

namespace regrade {
namespace {

using namespace ffmpeg;  // NOLINT: owners of its objects

// x264's output depends on the number of threads: one that follows from the height gives the
// same film anywhere. Threads work on frames one behind the other, and where a frame is too low
// for them, what one reads of another is a race: three frames of 64 x 48 pixels by four threads
// gave another film in one of six runs.
int EncoderThreads(int height) { return std::clamp(height / 96, 1, 4); }

// x264 (core 164) with AVX-512 reads memory that it never wrote: films of 64 x 48 pixels had
// other bytes where malloc gave back other garbage. With AVX2 they are the same, and encoding
// takes as long (20 films of 1280 x 960: 9.2 s each way).
const char* InstructionsOfX264() {
  return (av_get_cpu_flags() & AV_CPU_FLAG_AVX512) != 0 ? "asm=avx2" : "asm=auto";
}

uint8_t Byte(float value) {  // as in our PNG files
  return value > 0 ? static_cast<uint8_t>(std::min(value, 1.f) * 255.f + 0.5f) : 0;
}

Image InColor(const Image& picture) {
  if (picture.channels == 3) return picture;
  Image color(picture.width, picture.height);
  for (size_t i = 0; i < color.pixels.size(); ++i) color.pixels[i] = picture.pixels[i / 3];
  return color;
}

// The bytes of an RGB picture with its last column and row repeated up to `width` x `height`.
void PutBytes(const Image& picture, int width, int height, uint8_t* to) {
  for (int y = 0; y < height; ++y) {
    const float* const row = picture.at(0, std::min(y, picture.height - 1));
    for (int i = 0; i < 3 * picture.width; ++i) *to++ = Byte(row[i]);
    for (int x = picture.width; x < width; ++x, to += 3) std::copy_n(to - 3, 3, to);
  }
}

}  // namespace

struct VideoWriter::State {
  std::string path;
  int width, height;  // of the frames
  double frames_per_second;
  int64_t frames = 0;        // given to the encoder
  std::vector<uint8_t> rgb;  // a frame at the even size
  Mp4File film;
  Codec encoder;
  Scaler scaler;
  Frame yuv{Allocated(av_frame_alloc())};
  Packet packet{Allocated(av_packet_alloc())};

  State(const std::string& film_path, int frame_width, int frame_height, double rate)
      : path(film_path),
        width(frame_width),
        height(frame_height),
        frames_per_second(rate),
        film(film_path) {}

  // libx264 itself is there: it fails where memory or threads are not.
  void CheckEncoder(int code, const char* step) const {
    if (code < 0)
      throw ResourceError(std::string("H.264 encoder: cannot ") + step + ": " + ErrorText(code),
                          path, "close other programs, or make a smaller film (--film-size)");
  }

  void OpenEncoder() {
    const AVCodec* codec = avcodec_find_encoder_by_name("libx264");
    if (codec == nullptr)
      throw ProgramError("no H.264 encoder", path,
                         "install FFmpeg's libavcodec with libx264, or go without the video");
    encoder.reset(Allocated(avcodec_alloc_context3(codec)));
    encoder->width = width + width % 2;
    encoder->height = height + height % 2;
    encoder->framerate = av_d2q(frames_per_second, 100000);
    encoder->time_base = av_inv_q(encoder->framerate);
    encoder->pix_fmt = AV_PIX_FMT_YUV420P;
    encoder->gop_size = kFilmGroup;
    encoder->color_range = AVCOL_RANGE_MPEG;
    encoder->colorspace = AVCOL_SPC_BT709;
    encoder->color_primaries = AVCOL_PRI_BT709;
    encoder->color_trc = AVCOL_TRC_IEC61966_2_1;  // sRGB
    encoder->thread_count = EncoderThreads(height);
    encoder->flags |= AV_CODEC_FLAG_BITEXACT;
    if (film.WantsGlobalHeader()) encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    CheckEncoder(av_opt_set_int(encoder->priv_data, "crf", kVideoCrf, 0), "set the quality");
    CheckEncoder(av_opt_set(encoder->priv_data, "x264-params", InstructionsOfX264(), 0),
                 "choose its instructions");
    CheckEncoder(avcodec_open2(encoder.get(), codec, nullptr), "open it");
  }

  void OpenScaler() {
    const int w = encoder->width, h = encoder->height;
    scaler.reset(
        Allocated(sws_getContext(w, h, AV_PIX_FMT_RGB24, w, h, AV_PIX_FMT_YUV420P,
                                 SWS_BICUBIC | SWS_ACCURATE_RND, nullptr, nullptr, nullptr)));
    const int* matrix = sws_getCoefficients(SWS_CS_ITU709);
    sws_setColorspaceDetails(scaler.get(), matrix, 1, matrix, 0, 0, 1 << 16, 1 << 16);
    yuv->format = AV_PIX_FMT_YUV420P;
    yuv->width = w;
    yuv->height = h;
    CheckEncoder(av_frame_get_buffer(yuv.get(), 0), "allocate a frame");
    constexpr size_t kReadBeyond = 64;  // libswscale reads whole vectors
    rgb.resize(static_cast<size_t>(3) * w * h + kReadBeyond);
  }

  void OpenFile() {
    AVCodecParameters* parameters = Allocated(avcodec_parameters_alloc());
    const std::unique_ptr<AVCodecParameters, void (*)(AVCodecParameters*)> owner(
        parameters, [](AVCodecParameters* p) { avcodec_parameters_free(&p); });
    CheckEncoder(avcodec_parameters_from_context(parameters, encoder.get()),
                 "describe the stream");
    film.Begin(*parameters, encoder->time_base);
  }

  // Encodes `frame` (null: the rest) and writes what the encoder gives out.
  void Encode(const AVFrame* frame) {
    CheckEncoder(avcodec_send_frame(encoder.get(), frame), "take a frame");
    for (;;) {
      const int code = avcodec_receive_packet(encoder.get(), packet.get());
      if (code == AVERROR(EAGAIN) || code == AVERROR_EOF) return;
      CheckEncoder(code, "encode a frame");
      film.Write(packet.get());
    }
  }
};

VideoWriter::VideoWriter(const std::string& path, int width, int height,
                         double frames_per_second) {
  REGRADE_CHECK_GT(width, 0);
  REGRADE_CHECK_GT(height, 0);
  REGRADE_CHECK_GT(frames_per_second, 0);
  av_log_set_level(AV_LOG_QUIET);  // errors come back as codes
  state_ = std::make_unique<State>(path, width, height, frames_per_second);
  state_->OpenEncoder();
  state_->OpenScaler();
  state_->OpenFile();
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::Add(const Image& frame) {
  State& s = *state_;
  REGRADE_CHECK_EQ(frame.width, s.width);
  REGRADE_CHECK_EQ(frame.height, s.height);
  if (frame.channels == 3)
    PutBytes(frame, s.yuv->width, s.yuv->height, s.rgb.data());
  else
    PutBytes(InColor(CompositeOnWhite(frame)), s.yuv->width, s.yuv->height, s.rgb.data());
  const uint8_t* const rows[] = {s.rgb.data()};
  const int stride[] = {3 * s.yuv->width};
  s.CheckEncoder(av_frame_make_writable(s.yuv.get()), "allocate a frame");
  sws_scale(s.scaler.get(), rows, stride, 0, s.yuv->height, s.yuv->data, s.yuv->linesize);
  if (s.frames > 0 && s.frames % kFilmGroup == 0) {
    s.Encode(nullptr);
    s.OpenEncoder();
  }
  s.yuv->pts = s.frames++;
  s.Encode(s.yuv.get());
}

void VideoWriter::Finish() {
  state_->Encode(nullptr);
  state_->film.Finish(state_->frames);
}

}  // namespace regrade
