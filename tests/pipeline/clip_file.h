// Films made by tests: any frames, codec, times and rotation.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/display.h>
#include <libavutil/log.h>
#include <libavutil/opt.h>
#include <libswscale/swscale.h>
}

#include "kernels/scene/image.h"
#include "pipeline/images/ffmpeg_pointers.h"

namespace regrade::testing {

struct ClipSpec {
  const char* encoder = "libx264";  // or "libx265"
  const char* container = "mp4";    // or "mov", "matroska"
  int turn = 0;                     // degrees clockwise that a player turns the frames
  bool mirrored = false;            // it then shows them with left and right exchanged
  bool interlaced = false;          // marks the frames as two moments, even rows first
  std::vector<int64_t> times = {};  // of the frames, in 1/600 s; empty: 25 a second
  AVColorPrimaries primaries = AVCOL_PRI_BT709;
  AVColorTransferCharacteristic transfer = AVCOL_TRC_BT709;
  AVColorSpace matrix = AVCOL_SPC_BT709;
  AVPixelFormat pixels = AV_PIX_FMT_YUV420P;
  AVRational aspect = {1, 1};  // of a pixel
};

inline constexpr int kTicks = 24;  // of a frame, in 1/600 s

// Encodes nearly without loss. False if the encoder is not installed.
inline bool WriteClip(const std::string& path, const std::vector<Image>& frames,
                      const ClipSpec& spec = {}) {
  using namespace ffmpeg;  // NOLINT
  av_log_set_level(AV_LOG_QUIET);
  const AVCodec* codec = avcodec_find_encoder_by_name(spec.encoder);
  if (codec == nullptr) return false;
  const int w = frames[0].width, h = frames[0].height;
  AVFormatContext* opened = nullptr;
  EXPECT_GE(avformat_alloc_output_context2(&opened, nullptr, spec.container, Url(path).c_str()),
            0);
  const Output output(opened);
  const Codec encoder(Allocated(avcodec_alloc_context3(codec)));
  encoder->width = w;
  encoder->height = h;
  encoder->time_base = {1, 600};
  encoder->framerate = {25, 1};
  encoder->pix_fmt = spec.pixels;
  encoder->color_primaries = spec.primaries;
  encoder->color_trc = spec.transfer;
  encoder->colorspace = spec.matrix;
  encoder->color_range = AVCOL_RANGE_MPEG;
  encoder->sample_aspect_ratio = spec.aspect;
  encoder->gop_size = 12;
  encoder->thread_count = 1;
  if (spec.interlaced) encoder->flags |= AV_CODEC_FLAG_INTERLACED_DCT;
  if ((output->oformat->flags & AVFMT_GLOBALHEADER) != 0)
    encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  av_opt_set(encoder->priv_data, "crf", "4", 0);
  av_opt_set(encoder->priv_data, "preset", "veryfast", 0);
  // Of fewer frames than B-frames delay, x265's times of decoding are memory that was never
  // set.
  av_opt_set(encoder->priv_data, "x265-params", "log-level=none:pools=none:bframes=0", 0);
  EXPECT_GE(avcodec_open2(encoder.get(), codec, nullptr), 0);
  AVStream* stream = avformat_new_stream(opened, nullptr);
  avcodec_parameters_from_context(stream->codecpar, encoder.get());
  stream->time_base = encoder->time_base;
  stream->sample_aspect_ratio = spec.aspect;
  if (spec.turn != 0 || spec.mirrored) {
    constexpr size_t kBytes = 9 * sizeof(int32_t);
#if LIBAVFORMAT_VERSION_INT >= AV_VERSION_INT(60, 15, 100)
    AVCodecParameters& codecpar = *stream->codecpar;
    uint8_t* const data =
        av_packet_side_data_new(&codecpar.coded_side_data, &codecpar.nb_coded_side_data,
                                AV_PKT_DATA_DISPLAYMATRIX, kBytes, 0)
            ->data;
#else
    uint8_t* const data = av_stream_new_side_data(stream, AV_PKT_DATA_DISPLAYMATRIX, kBytes);
#endif
    av_display_rotation_set(reinterpret_cast<int32_t*>(data), spec.turn);
    av_display_matrix_flip(reinterpret_cast<int32_t*>(data), spec.mirrored, 0);
  }
  EXPECT_GE(avio_open(&opened->pb, Url(path).c_str(), AVIO_FLAG_WRITE), 0);
  EXPECT_GE(avformat_write_header(opened, nullptr), 0);
  const Scaler scaler(
      Allocated(sws_getContext(w, h, AV_PIX_FMT_RGB48, w, h, spec.pixels,
                               SWS_BICUBIC | SWS_ACCURATE_RND, nullptr, nullptr, nullptr)));
  const int* matrix = sws_getCoefficients(spec.matrix);
  sws_setColorspaceDetails(scaler.get(), matrix, 1, matrix, 0, 0, 1 << 16, 1 << 16);
  const Packet packet(Allocated(av_packet_alloc()));
  const auto drain = [&] {
    while (avcodec_receive_packet(encoder.get(), packet.get()) >= 0) {
      packet->duration = kTicks;  // players pass over a last frame without one
      av_packet_rescale_ts(packet.get(), encoder->time_base, stream->time_base);
      packet->stream_index = stream->index;
      EXPECT_GE(av_interleaved_write_frame(opened, packet.get()), 0);
    }
  };
  for (size_t i = 0; i < frames.size(); ++i) {
    std::vector<uint16_t> rgb(frames[i].pixels.size());
    for (size_t k = 0; k < rgb.size(); ++k)
      rgb[k] = static_cast<uint16_t>(frames[i].pixels[k] * 65535.f + 0.5f);
    const Frame frame(Allocated(av_frame_alloc()));
    frame->format = spec.pixels;
    frame->width = w;
    frame->height = h;
    EXPECT_GE(av_frame_get_buffer(frame.get(), 0), 0);
    const uint8_t* const rows[] = {reinterpret_cast<const uint8_t*>(rgb.data())};
    const int stride[] = {6 * w};
    sws_scale(scaler.get(), rows, stride, 0, h, frame->data, frame->linesize);
    frame->pts = spec.times.empty() ? static_cast<int64_t>(i) * kTicks : spec.times[i];
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(58, 7, 100)
    if (spec.interlaced)
      frame->flags |= AV_FRAME_FLAG_INTERLACED | AV_FRAME_FLAG_TOP_FIELD_FIRST;
#else
    frame->interlaced_frame = frame->top_field_first = spec.interlaced ? 1 : 0;
#endif
    EXPECT_GE(avcodec_send_frame(encoder.get(), frame.get()), 0);
    drain();
  }
  avcodec_send_frame(encoder.get(), nullptr);
  drain();
  EXPECT_GE(av_write_trailer(opened), 0);
  return true;
}

}  // namespace regrade::testing
