// Chunks of RIFF, little-endian: a name of four bytes, the size of four, the body, padded to an
// even size.
#include "pipeline/images/webp_header.h"

namespace regrade {
namespace {

uint64_t Little(std::string_view bytes, size_t at, size_t count) {
  uint64_t value = 0;
  for (size_t i = 0; i < count; ++i)
    value |= static_cast<uint64_t>(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
  return value;
}

void TakeSize(std::string_view name, std::string_view body, WebpHeader* header) {
  if (name == "VP8X" && body.size() >= 10) {
    header->width = 1 + static_cast<int64_t>(Little(body, 4, 3));
    header->height = 1 + static_cast<int64_t>(Little(body, 7, 3));
  } else if (name == "VP8L" && body.size() >= 5) {
    const uint64_t bits = Little(body, 1, 4);
    header->width = 1 + static_cast<int64_t>(bits & 0x3fff);
    header->height = 1 + static_cast<int64_t>(bits >> 14 & 0x3fff);
  } else if (name == "VP8 " && body.size() >= 10) {
    header->width = static_cast<int64_t>(Little(body, 6, 2) & 0x3fff);
    header->height = static_cast<int64_t>(Little(body, 8, 2) & 0x3fff);
  }
}

}  // namespace

WebpHeader ReadWebpHeader(std::string_view bytes) {
  WebpHeader header;
  for (size_t at = 12; at + 8 <= bytes.size();) {
    const std::string_view name = bytes.substr(at, 4);
    const uint64_t size = Little(bytes, at + 4, 4);
    const std::string_view body = bytes.substr(at + 8, size);
    // The first chunk has the canvas.
    if (at == 12) TakeSize(name, body, &header);
    if (name == "EXIF" && header.exif.empty()) header.exif = body;
    if (name == "ICCP" && header.icc.empty()) header.icc = body;
    at += 8 + size + size % 2;
  }
  return header;
}

}  // namespace regrade
