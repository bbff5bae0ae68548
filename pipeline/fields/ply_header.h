// The header of a PLY file (Turk 1994): its elements, with the type of each property.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

enum class PlyType { kI8, kU8, kI16, kU16, kI32, kU32, kF32, kF64 };
size_t SizeOf(PlyType type);  // bytes in a binary file
bool IsInteger(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kF32;
  std::optional<PlyType> count_type;  // of a list: the type of the number in front of its items
};

struct PlyElement {
  std::string name;
  uint64_t count = 0;  // as the header says: compare it with the size of the file
  std::vector<PlyProperty> properties;

  std::optional<size_t> Find(std::string_view property) const;
  // The fewest bytes that a row takes in a file of this encoding; all of them where the
  // encoding is binary and there is no list.
  uint64_t RowBytes(PlyEncoding encoding) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  // obj_info, too
  std::string line_end;               // "\n" or "\r\n"
  size_t after_format = 0;            // offset of the line after that of the encoding
  size_t bytes = 0;                   // offset of the first row

  std::optional<size_t> Find(std::string_view element) const;
};

// Whether the bytes begin as a PLY file does.
bool LooksLikePly(std::string_view bytes);

// Throws Error(kInput) with `where` for a header that is not one, has no end in its first
// megabyte, or names an element, or a property of an element, twice.
PlyHeader ParsePlyHeader(std::string_view bytes, const std::string& where);

}  // namespace regrade
