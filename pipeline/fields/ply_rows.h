// The rows of an element of a PLY file.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/fields/ply_header.h"

namespace regrade {

class PlyRows {
 public:
  // Stands before the first row of `header.elements[element]`. `bytes` and `header` are those
  // of the file and must outlive the rows. Throws Error(kInput) with `where` if the file ends
  // before, or is too short for as many rows as the header says.
  PlyRows(std::string_view bytes, const PlyHeader& header, size_t element, std::string where);

  // Whether all rows have one length, so that Skip goes over them at once.
  bool have_one_length() const;
  // Goes over rows of one length.
  void Skip(uint64_t rows);
  // Goes to the next row; called at most `count` times. Throws Error(kInput).
  void Next();
  // The bytes of a property in the file: of a text without separators, of a list with its
  // count.
  std::string_view Cell(size_t property) const { return cells_[property]; }
  // The number of a property that is no list. Throws Error(kInput) for a word that is no
  // number.
  double Number(size_t property) const;
  // The file after the current row.
  std::string_view left() const { return left_; }

 private:
  void SkipElement(const PlyElement& element);
  void CheckCount(const PlyElement& element) const;
  void Take(const PlyProperty& property);
  std::string_view TakeBytes(uint64_t size);
  std::string_view TakeWord();
  [[noreturn]] void RefuseEnd() const;

  const PlyHeader& header_;
  const PlyElement* element_;
  std::string where_;
  std::string_view left_;
  std::vector<std::string_view> cells_;
  uint64_t row_ = 0;
};

// A number as a cell of this type and encoding has it; `type` is kF32 or kF64.
std::string PlyCell(float value, PlyType type, PlyEncoding encoding);

}  // namespace regrade
