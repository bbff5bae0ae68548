#include "pipeline/files/npy_header.h"

#include <charconv>
#include <cstring>
#include <optional>

#include "kernels/base/checked_math.h"
#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr uint64_t kMaxHeader = 64 << 10;
constexpr size_t kMaxAxes = 8;

struct TypeRow {
  ArrayType type;
  const char* name;
  int64_t size;
};
constexpr TypeRow kTypes[] = {{ArrayType::kU8, "|u1", 1},  {ArrayType::kI32, "<i4", 4},
                              {ArrayType::kI64, "<i8", 8}, {ArrayType::kU64, "<u8", 8},
                              {ArrayType::kF16, "<f2", 2}, {ArrayType::kF32, "<f4", 4},
                              {ArrayType::kF64, "<f8", 8}};

// Parses the header: a Python dictionary literal with three known keys, and nothing else.
class LiteralReader {
 public:
  LiteralReader(std::string_view text, const std::string& where) : text_(text), where_(where) {}

  [[noreturn]] void Refuse(const std::string& why) const {
    throw InputError("array header: " + why, where_);
  }
  void SkipSpace() {
    while (at_ < text_.size() && std::strchr(" \t\r\n", text_[at_]) != nullptr) ++at_;
  }
  bool Accept(char c) {
    SkipSpace();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void Expect(char c) {
    if (!Accept(c)) Refuse(Concat("'", c, "' expected at byte ", at_, " of the dictionary"));
  }
  std::string_view Quoted() {
    SkipSpace();
    const char quote = at_ < text_.size() ? text_[at_] : '\0';
    if (quote != '\'' && quote != '"') Refuse("a quoted name expected");
    const size_t end = text_.find(quote, at_ + 1);
    if (end == std::string_view::npos) Refuse("a name without its closing quote");
    const std::string_view result = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return result;
  }
  bool Boolean() {
    SkipSpace();
    for (const bool value : {true, false}) {
      const std::string_view word = value ? "True" : "False";
      if (text_.substr(at_, word.size()) != word) continue;
      at_ += word.size();
      return value;
    }
    Refuse("True or False expected");
  }
  std::vector<int64_t> Shape() {
    std::vector<int64_t> shape;
    Expect('(');
    while (!Accept(')')) {
      SkipSpace();
      int64_t axis = 0;
      const char* begin = text_.data() + at_;
      const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), axis);
      if (error != std::errc() || axis < 0) Refuse("an axis that is not a length");
      at_ += static_cast<size_t>(end - begin);
      Accept('L');  // written by Python 2
      shape.push_back(axis);
      if (shape.size() > kMaxAxes) Refuse("more than 8 axes");
      if (!Accept(',')) {
        Expect(')');
        break;
      }
    }
    return shape;
  }
  ArrayType Type() {
    SkipSpace();
    if (at_ < text_.size() && text_[at_] == '[') Refuse("structured arrays are not read");
    const std::string_view name = Quoted();
    if (name == "|b1") return ArrayType::kU8;
    for (const TypeRow& row : kTypes)
      if (name == row.name || (row.size == 1 && name.size() == 3 && name.substr(1) == "u1"))
        return row.type;
    if (name.substr(0, 1) == ">") Refuse("big-endian data (" + std::string(name) + ")");
    if (name.find('O') != std::string_view::npos)
      Refuse("Python objects: refused, they could run code");
    Refuse("element type '" + std::string(name) + "' is not read");
  }
  bool AtEnd() {
    SkipSpace();
    return at_ == text_.size();
  }

 private:
  std::string_view text_;
  const std::string& where_;
  size_t at_ = 0;
};

}  // namespace

int64_t SizeOf(ArrayType type) {
  for (const TypeRow& row : kTypes)
    if (row.type == type) return row.size;
  return 0;
}

const char* NameOf(ArrayType type) {
  for (const TypeRow& row : kTypes)
    if (row.type == type) return row.name;
  return "?";
}

NpyHeader ParseNpyHeader(std::string_view bytes, const std::string& where) {
  const auto refuse = [&where](const std::string& why) {
    throw InputError("array header: " + why, where);
  };
  if (bytes.size() < 10 || bytes.substr(0, kMagic.size()) != kMagic)
    refuse("this is not a NumPy array");
  const int version = static_cast<unsigned char>(bytes[6]);
  if (version < 1 || version > 3) refuse("unknown format " + std::to_string(version));
  const size_t prefix = version == 1 ? 10 : 12;
  if (bytes.size() < prefix) refuse("the file ends inside it");
  uint64_t length = 0;
  for (size_t i = prefix; i-- > 8;) length = length << 8 | static_cast<unsigned char>(bytes[i]);
  if (length > kMaxHeader || length > bytes.size() - prefix)
    refuse(std::to_string(length) + " bytes long, longer than the file or than 65536");

  NpyHeader header;
  header.data_offset = prefix + length;
  LiteralReader reader(bytes.substr(prefix, length), where);
  bool have_type = false, have_order = false, have_shape = false, fortran = false;
  reader.Expect('{');
  while (!reader.Accept('}')) {
    const std::string_view key = reader.Quoted();
    reader.Expect(':');
    bool* have = key == "descr"           ? &have_type
                 : key == "fortran_order" ? &have_order
                 : key == "shape"         ? &have_shape
                                          : nullptr;
    if (have == nullptr) reader.Refuse("unknown key '" + std::string(key) + "'");
    if (*have) reader.Refuse("key '" + std::string(key) + "' twice");
    *have = true;
    if (have == &have_type) header.type = reader.Type();
    if (have == &have_order) fortran = reader.Boolean();
    if (have == &have_shape) header.shape = reader.Shape();
    if (!reader.Accept(',')) {
      reader.Expect('}');
      break;
    }
  }
  if (!reader.AtEnd()) reader.Refuse("something follows the dictionary");
  if (!have_type || !have_order || !have_shape) reader.Refuse("a key is missing");
  if (fortran && header.shape.size() > 1) reader.Refuse("Fortran order is not read");

  std::optional<uint64_t> product = static_cast<uint64_t>(SizeOf(header.type));
  for (const int64_t axis : header.shape) {
    product = CheckedMul(*product, static_cast<uint64_t>(axis));
    if (!product) reader.Refuse("the shape's product is too large");
  }
  header.data_bytes = *product;
  return header;
}

std::string MakeNpyHeader(ArrayType type, const std::vector<int64_t>& shape) {
  std::string text =
      "{'descr': '" + std::string(NameOf(type)) + "', 'fortran_order': False, 'shape': (";
  for (size_t i = 0; i < shape.size(); ++i)
    text += std::to_string(shape[i]) + (i + 1 < shape.size() ? ", " : "");
  text += shape.size() == 1 ? ",), }" : "), }";
  const size_t prefix = 10;
  const size_t total = (prefix + text.size() + 1 + 63) / 64 * 64;
  text.resize(total - prefix - 1, ' ');
  text += '\n';
  std::string bytes(kMagic);
  bytes += {'\x01', '\x00', static_cast<char>(text.size() & 255),
            static_cast<char>(text.size() >> 8)};
  return bytes + text;
}

}  // namespace regrade
