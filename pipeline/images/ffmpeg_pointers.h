// Owners of FFmpeg's objects, for the files that write and read films.
#pragma once

#include <memory>
#include <new>
#include <string>

struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVPacket;
struct SwsContext;

namespace regrade::ffmpeg {

struct Free {
  void operator()(AVCodecContext* codec) const;
  void operator()(AVFrame* frame) const;
  void operator()(AVPacket* packet) const;
  void operator()(SwsContext* scaler) const;
};
struct CloseInput {
  void operator()(AVFormatContext* input) const;
};
struct CloseOutput {
  void operator()(AVFormatContext* output) const;
};
using Codec = std::unique_ptr<AVCodecContext, Free>;
using Frame = std::unique_ptr<AVFrame, Free>;
using Packet = std::unique_ptr<AVPacket, Free>;
using Scaler = std::unique_ptr<SwsContext, Free>;
using Input = std::unique_ptr<AVFormatContext, CloseInput>;
using Output = std::unique_ptr<AVFormatContext, CloseOutput>;

// Throws std::bad_alloc for a null pointer.
template <typename T>
T* Allocated(T* pointer) {
  if (pointer == nullptr) throw std::bad_alloc();
  return pointer;
}

// The text of FFmpeg's error code.
std::string ErrorText(int code);

// FFmpeg takes what stands before a colon for a protocol.
std::string Url(const std::string& path);

}  // namespace regrade::ffmpeg
