#include "pipeline/images/ffmpeg_pointers.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

namespace regrade::ffmpeg {

void Free::operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
void Free::operator()(AVFrame* frame) const { av_frame_free(&frame); }
void Free::operator()(AVPacket* packet) const { av_packet_free(&packet); }
void Free::operator()(SwsContext* scaler) const { sws_freeContext(scaler); }

void CloseInput::operator()(AVFormatContext* input) const { avformat_close_input(&input); }
void CloseOutput::operator()(AVFormatContext* output) const {
  avio_closep(&output->pb);
  avformat_free_context(output);
}

std::string ErrorText(int code) {
  char text[AV_ERROR_MAX_STRING_SIZE] = "";
  av_strerror(code, text, sizeof text);
  return text;
}

std::string Url(const std::string& path) { return "file:" + path; }

}  // namespace regrade::ffmpeg
