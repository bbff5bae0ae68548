// Messages between the program and its decoder (decoder_process.h): fields one after the other,
// then the values of a picture.
//
// A message is: the number of bytes of its fields (8 bytes), the fields, and for a reply with a
// picture its values as floats, whose number the fields tell.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

#include "kernels/base/error.h"
#include "pipeline/images/film_source.h"
#include "pipeline/images/picture_decoder.h"

namespace regrade {

enum class DecoderRequest : char { kPicture, kFilm, kNext, kFramePicture, kFrameGrey, kClose };
enum class DecoderReply : char { kDone, kError, kNoMemory, kNoResources, kBug };

// Argument of the hidden form of the program that decodes.
inline constexpr char kDecoderFlag[] = "--decode";
// No fields are longer: notices and names.
inline constexpr uint64_t kLongestFields = 64 << 20;

class MessageWriter {
 public:
  template <typename T>
  requires std::is_trivially_copyable_v<T>
  void Put(const T& value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void PutText(const std::string& text) {
    Put<uint64_t>(text.size());
    bytes_ += text;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

class MessageReader {
 public:
  explicit MessageReader(std::string_view bytes) : left_(bytes) {}

  template <typename T>
  requires std::is_trivially_copyable_v<T> T Take() {
    REGRADE_CHECK(left_.size() >= sizeof(T));
    T value;
    std::memcpy(&value, left_.data(), sizeof value);
    left_.remove_prefix(sizeof value);
    return value;
  }
  std::string TakeText() {
    const uint64_t size = Take<uint64_t>();
    REGRADE_CHECK(left_.size() >= size);
    const std::string text(left_.substr(0, size));
    left_.remove_prefix(size);
    return text;
  }

 private:
  std::string_view left_;
};

inline void PutSize(const Image& image, MessageWriter* message) {
  for (const int side : {image.width, image.height, image.channels}) message->Put(side);
}
// An image of that size, for its values to be received.
inline Image TakeSize(MessageReader* message) {
  const int width = message->Take<int>(), height = message->Take<int>(),
            channels = message->Take<int>();
  REGRADE_CHECK(width > 0 && height > 0 && channels > 0 && channels <= 4);
  return Image(width, height, channels);
}

// What is left of a picture once it is normalized: not how its colours were stored.
inline void PutPicture(const StoredPicture& picture, MessageWriter* message) {
  for (const int value : {picture.bits, picture.orientation}) message->Put(value);
  for (const double value :
       {picture.focal_mm, picture.focal_35mm, picture.focal_plane_px_per_mm, picture.exif_width,
        picture.clipped, picture.light})
    message->Put(value);
  message->Put<uint8_t>(picture.gps ? 1 : 0);
  if (picture.gps) message->Put(*picture.gps);
  for (const std::string& text : {picture.colors, picture.taken}) message->PutText(text);
  message->Put<uint64_t>(picture.notices.size());
  for (const std::string& notice : picture.notices) message->PutText(notice);
  PutSize(picture.image, message);
}
inline StoredPicture TakePicture(MessageReader* message) {
  StoredPicture picture;
  for (int* value : {&picture.bits, &picture.orientation}) *value = message->Take<int>();
  for (double* value : {&picture.focal_mm, &picture.focal_35mm, &picture.focal_plane_px_per_mm,
                        &picture.exif_width, &picture.clipped, &picture.light})
    *value = message->Take<double>();
  if (message->Take<uint8_t>() != 0) picture.gps = message->Take<GeoPosition>();
  for (std::string* text : {&picture.colors, &picture.taken}) *text = message->TakeText();
  for (uint64_t left = message->Take<uint64_t>(); left > 0; --left)
    picture.notices.push_back(message->TakeText());
  picture.image = TakeSize(message);
  return picture;
}

inline void PutInfo(const VideoInfo& info, MessageWriter* message) {
  message->Put(info.width);
  message->Put(info.height);
  message->Put(info.seconds);
  message->Put(info.frames);
  message->Put(info.orientation);
  message->PutText(info.colors);
}
inline VideoInfo TakeInfo(MessageReader* message) {
  VideoInfo info;
  info.width = message->Take<int>();
  info.height = message->Take<int>();
  info.seconds = message->Take<double>();
  info.frames = message->Take<int64_t>();
  info.orientation = message->Take<int>();
  info.colors = message->TakeText();
  return info;
}

}  // namespace regrade
