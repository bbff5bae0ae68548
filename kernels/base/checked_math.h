// Products and sums of sizes read from files: an overflow gives no value instead of wrapping.
#pragma once

#include <cstdint>
#include <optional>

namespace regrade {

inline std::optional<uint64_t> CheckedMul(uint64_t a, uint64_t b) {
  uint64_t result;
  if (__builtin_mul_overflow(a, b, &result)) return std::nullopt;
  return result;
}

}  // namespace regrade
