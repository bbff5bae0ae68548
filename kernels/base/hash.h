// A fast 64-bit content hash that detects changed files and options. It is not cryptographic:
// it does not resist deliberate collisions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "kernels/base/random.h"

namespace regrade {

// The value depends on the bytes alone, not on how they are split over calls.
class Hasher {
 public:
  void Add(const void* data, size_t size) {
    const unsigned char* bytes = static_cast<const unsigned char*>(data);
    length_ += size;
    while (size > 0) {
      if (pending_ == 0 && size >= sizeof(uint64_t)) {
        uint64_t word;
        std::memcpy(&word, bytes, sizeof word);
        Mix(word);
        bytes += sizeof word;
        size -= sizeof word;
        continue;
      }
      tail_ |= static_cast<uint64_t>(*bytes) << (8 * pending_);
      ++bytes;
      --size;
      if (++pending_ == sizeof(uint64_t)) {
        Mix(tail_);
        tail_ = 0;
        pending_ = 0;
      }
    }
  }
  void Add(std::string_view text) { Add(text.data(), text.size()); }

  uint64_t Value() const { return MixBits(MixBits(state_ ^ tail_) ^ length_); }

 private:
  // Multiply and fold (as in wyhash): one multiplication per word, full avalanche.
  void Mix(uint64_t word) {
    const unsigned __int128 product =
        static_cast<unsigned __int128>(state_ ^ word ^ 0xa0761d6478bd642full) *
        0xe7037ed1a0b428dbull;
    state_ = static_cast<uint64_t>(product) ^ static_cast<uint64_t>(product >> 64) ^ word;
  }

  uint64_t state_ = 0x243f6a8885a308d3ull;
  uint64_t tail_ = 0;
  uint64_t length_ = 0;
  int pending_ = 0;  // bytes in tail_
};

inline uint64_t HashOf(std::string_view bytes) {
  Hasher hasher;
  hasher.Add(bytes);
  return hasher.Value();
}

// Sixteen lower-case hexadecimal digits.
inline std::string HashText(uint64_t hash) {
  std::string text(16, '0');
  for (int i = 15; i >= 0; --i, hash >>= 4) text[i] = "0123456789abcdef"[hash & 15];
  return text;
}

}  // namespace regrade
