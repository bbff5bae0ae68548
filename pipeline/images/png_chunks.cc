#include "pipeline/images/png_chunks.h"

#include <array>
#include <cstdint>

namespace regrade {
namespace {

constexpr std::array<uint32_t, 256> MakeCrcTable() {
  std::array<uint32_t, 256> table{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t crc = i;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
    table[i] = crc;
  }
  return table;
}

uint32_t Crc32(std::string_view bytes) {
  static constexpr std::array<uint32_t, 256> kTable = MakeCrcTable();
  uint32_t crc = ~0u;
  for (const char byte : bytes)
    crc = (crc >> 8) ^ kTable[(crc ^ static_cast<unsigned char>(byte)) & 255];
  return ~crc;
}

uint32_t BigEndian32(std::string_view bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

}  // namespace

std::string FindPngDamage(std::string_view bytes) {
  constexpr size_t kSignature = 8, kFrame = 12;  // frame: length, type and CRC of a chunk
  size_t at = kSignature;
  for (;;) {
    if (bytes.size() < at + kFrame || bytes.size() - at - kFrame < BigEndian32(bytes, at))
      return "truncated: it ends at byte " + std::to_string(bytes.size()) +
             " inside the chunk that begins at byte " + std::to_string(at);
    const size_t length = BigEndian32(bytes, at);
    const std::string_view body = bytes.substr(at + 4, 4 + length);  // type and data
    if (Crc32(body) != BigEndian32(bytes, at + 8 + length))
      return "checksum error in the chunk at byte " + std::to_string(at);
    if (body.substr(0, 4) == "IEND") return "";
    at += kFrame + length;
  }
}

}  // namespace regrade
