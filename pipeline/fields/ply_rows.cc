#include "pipeline/fields/ply_rows.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr char kSeparators[] = " \t\r\n";
constexpr char kDamaged[] = "the file is incomplete or damaged: copy or download it again";

template <typename T>
double NumberOf(std::string_view bytes, bool reversed) {
  char ordered[sizeof(T)];
  std::copy_n(bytes.data(), sizeof(T), ordered);
  if (reversed) std::reverse(ordered, ordered + sizeof(T));
  T value;
  std::memcpy(&value, ordered, sizeof value);
  return static_cast<double>(value);
}

double BinaryNumber(std::string_view bytes, PlyType type, bool reversed) {
  // In the order of PlyType.
  constexpr double (*kRead[])(std::string_view, bool) = {
      NumberOf<int8_t>,  NumberOf<uint8_t>,  NumberOf<int16_t>, NumberOf<uint16_t>,
      NumberOf<int32_t>, NumberOf<uint32_t>, NumberOf<float>,   NumberOf<double>};
  return kRead[static_cast<size_t>(type)](bytes, reversed);
}

template <typename T>
std::string BinaryCell(T value, bool reversed) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  if (reversed) std::ranges::reverse(bytes);
  return bytes;
}

}  // namespace

PlyRows::PlyRows(std::string_view bytes, const PlyHeader& header, size_t element,
                 std::string where)
    : header_(header),
      element_(&header.elements[element]),
      where_(std::move(where)),
      left_(bytes.substr(header.bytes)) {
  for (size_t i = 0; i < element; ++i) SkipElement(header.elements[i]);
  CheckCount(*element_);
  cells_.resize(element_->properties.size());
}

void PlyRows::CheckCount(const PlyElement& element) const {
  const uint64_t row = element.RowBytes(header_.encoding);
  // The last word of a text needs no separator.
  const uint64_t room = left_.size() + (header_.encoding == PlyEncoding::kAscii ? 1 : 0);
  if (row > 0 && element.count > room / row)
    throw InputError(Concat("its header says ", element.count, " of element '",
                            Printable(element.name), "', but of at least ", row,
                            " bytes each only ", room / row, " fit into the file"),
                     where_, kDamaged);
}

void PlyRows::SkipElement(const PlyElement& element) {
  CheckCount(element);
  if (element.properties.empty()) return;
  for (uint64_t i = 0; i < element.count; ++i)
    for (const PlyProperty& property : element.properties) Take(property);
}

void PlyRows::RefuseEnd() const {
  throw InputError(Concat("it ends in row ", row_, " of element '", Printable(element_->name),
                          "', of which its header says ", element_->count),
                   where_, kDamaged);
}

std::string_view PlyRows::TakeBytes(uint64_t size) {
  if (size > left_.size()) RefuseEnd();
  const std::string_view bytes = left_.substr(0, size);
  left_.remove_prefix(size);
  return bytes;
}

std::string_view PlyRows::TakeWord() {
  left_.remove_prefix(std::min(left_.find_first_not_of(kSeparators), left_.size()));
  if (left_.empty()) RefuseEnd();
  return TakeBytes(std::min(left_.find_first_of(kSeparators), left_.size()));
}

void PlyRows::Take(const PlyProperty& property) {
  const bool ascii = header_.encoding == PlyEncoding::kAscii;
  if (!property.count_type) {
    ascii ? TakeWord() : TakeBytes(SizeOf(property.type));
    return;
  }
  if (ascii) {
    uint32_t items = 0;
    if (!ParseNumber(TakeWord(), &items))
      throw InputError(Concat("row ", row_, ": the list '", Printable(property.name),
                              "' does not begin with its length"),
                       where_, kDamaged);
    for (; items > 0; --items) TakeWord();
    return;
  }
  const double items =
      BinaryNumber(TakeBytes(SizeOf(*property.count_type)), *property.count_type,
                   header_.encoding == PlyEncoding::kBigEndian);
  if (items < 0)
    throw InputError(Concat("row ", row_, ": the list '", Printable(property.name),
                            "' has a negative length"),
                     where_, kDamaged);
  TakeBytes(static_cast<uint64_t>(items) * SizeOf(property.type));
}

bool PlyRows::have_one_length() const {
  return header_.encoding != PlyEncoding::kAscii &&
         std::ranges::none_of(element_->properties, [](const PlyProperty& property) {
           return property.count_type.has_value();
         });
}

void PlyRows::Skip(uint64_t rows) {
  REGRADE_CHECK(have_one_length());
  TakeBytes(rows * element_->RowBytes(header_.encoding));
  row_ += rows;
}

void PlyRows::Next() {
  const bool ascii = header_.encoding == PlyEncoding::kAscii;
  for (size_t i = 0; i < cells_.size(); ++i) {
    const PlyProperty& property = element_->properties[i];
    if (ascii && !property.count_type) {
      cells_[i] = TakeWord();
      continue;
    }
    const std::string_view before = left_;
    Take(property);
    cells_[i] = before.substr(0, before.size() - left_.size());
  }
  ++row_;
}

double PlyRows::Number(size_t property) const {
  const PlyType type = element_->properties[property].type;
  const std::string_view cell = cells_[property];
  if (header_.encoding != PlyEncoding::kAscii)
    return BinaryNumber(cell, type, header_.encoding == PlyEncoding::kBigEndian);
  double value = 0;
  if (!ParseNumber(cell, &value))
    throw InputError(
        Concat("row ", row_ - 1, ", property '", Printable(element_->properties[property].name),
               "': '", Printable(cell.substr(0, 40)), "' is not a number"),
        where_, kDamaged);
  return value;
}

std::string PlyCell(float value, PlyType type, PlyEncoding encoding) {
  const bool reversed = encoding == PlyEncoding::kBigEndian;
  if (encoding != PlyEncoding::kAscii)
    return type == PlyType::kF64 ? BinaryCell(double{value}, reversed)
                                 : BinaryCell(value, reversed);
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace regrade
