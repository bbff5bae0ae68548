// What a file is, told by its first bytes: the name a person knows it by, and who decodes it.
#pragma once

#include <string>
#include <string_view>

namespace regrade {

struct ImageFormat {
  const char* name;         // "JPEG", "HEIC", "camera raw", ...
  const char* decoder;      // OpenImageIO's name of the format; empty when nobody here reads it
  bool from_memory = true;  // the decoder takes bytes; otherwise it opens the file by path
  // What a person can do when it cannot be decoded; empty for formats that everybody reads.
  const char* remedy = "";
};

// The format of a file that begins with `bytes`, or nullptr when it is not a picture (nor
// something a person may take for one). The extension of `path` matters in one case only:
// camera raw files that look like TIFF.
const ImageFormat* SniffImageFormat(std::string_view bytes, const std::string& path);

}  // namespace regrade
