// Picture formats, recognised by the first bytes of a file.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace regrade {

// Gets width, height and bytes per pixel from the header, before pixels are allocated; throws
// to refuse the file.
using PictureSizeCheck =
    std::function<void(int64_t width, int64_t height, int64_t pixel_bytes)>;

struct ImageFormat {
  const char* name;         // "JPEG", "HEIC", "camera raw", ...
  const char* decoder;      // OpenImageIO's name of the format; empty if it is not supported
  bool from_memory = true;  // the decoder takes bytes; else it opens the file by its path
  // What the user can do if it cannot be decoded; empty for common formats.
  const char* remedy = "";
};

// The format of a file that begins with `bytes`, or nullptr if it is no picture or video. The
// extension of `path` matters only for camera raw files that look like TIFF.
const ImageFormat* SniffImageFormat(std::string_view bytes, const std::string& path);

// A film (video_reader.h); it has no decoder as a picture.
bool IsVideo(const ImageFormat& format);
bool IsCameraRaw(const ImageFormat& format);

}  // namespace regrade
