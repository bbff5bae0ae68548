// Reads and writes the header of a NumPy array file (.npy, formats 1.0 to 3.0): element type
// and shape. Nothing is executed, and products are checked for overflow.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

enum class ArrayType { kU8, kI32, kI64, kU64, kF16, kF32, kF64 };

int64_t SizeOf(ArrayType type);      // bytes per element
const char* NameOf(ArrayType type);  // NumPy's: "<f4", "|u1", ...

struct NpyHeader {
  ArrayType type = ArrayType::kU8;
  std::vector<int64_t> shape;  // empty: a scalar
  uint64_t data_offset = 0;    // bytes before the first element
  uint64_t data_bytes = 0;     // product of the shape and the element's size
};

// `bytes` is the beginning of a .npy file, `where` names it in errors. Throws Error(kInput) for
// headers above 64 KiB, big-endian, object and structured types, Fortran order of more than one
// axis, and negative or overflowing shapes.
NpyHeader ParseNpyHeader(std::string_view bytes, const std::string& where);

// Header bytes, padded so that the data starts at a multiple of 64.
std::string MakeNpyHeader(ArrayType type, const std::vector<int64_t>& shape);

}  // namespace regrade
