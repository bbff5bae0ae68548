#include "pipeline/fields/ply_header.h"

#include <algorithm>
#include <iterator>
#include <unordered_set>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr size_t kMostBytes = 1 << 20;

struct TypeName {
  std::string_view name, sized_name;
  size_t bytes;
};
constexpr TypeName kTypes[] = {{"char", "int8", 1},     {"uchar", "uint8", 1},
                               {"short", "int16", 2},   {"ushort", "uint16", 2},
                               {"int", "int32", 4},     {"uint", "uint32", 4},
                               {"float", "float32", 4}, {"double", "float64", 8}};

[[noreturn]] void RefuseHeader(const std::string& why, const std::string& where) {
  throw InputError("PLY header: " + why, where,
                   "the file is damaged or was not written by a splat program");
}

PlyType TypeOf(const std::string& word, const std::string& where) {
  for (size_t i = 0; i < std::size(kTypes); ++i)
    if (word == kTypes[i].name || word == kTypes[i].sized_name) return static_cast<PlyType>(i);
  RefuseHeader("'" + Printable(word) + "' is not a type of numbers", where);
}

PlyEncoding EncodingOf(const std::string& word, const std::string& where) {
  if (word == "ascii") return PlyEncoding::kAscii;
  if (word == "binary_little_endian") return PlyEncoding::kLittleEndian;
  if (word == "binary_big_endian") return PlyEncoding::kBigEndian;
  RefuseHeader("'" + Printable(word) + "' is not an encoding", where);
}

// Words between spaces and tabs.
std::vector<std::string> WordsOf(std::string_view line) {
  std::vector<std::string> words;
  while (true) {
    const size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos) return words;
    const size_t end = std::min(line.find_first_of(" \t", begin), line.size());
    words.emplace_back(line.substr(begin, end - begin));
    line.remove_prefix(end);
  }
}

PlyElement ElementOf(const std::vector<std::string>& words, const std::string& where) {
  PlyElement element;
  if (words.size() != 3 || !ParseNumber(words[2], &element.count))
    RefuseHeader("an element without a name and a count", where);
  element.name = words[1];
  return element;
}

PlyProperty PropertyOf(const std::vector<std::string>& words, const std::string& where) {
  PlyProperty property;
  const bool list = words.size() == 5 && words[1] == "list";
  if (!list && words.size() != 3) RefuseHeader("a property without a type and a name", where);
  if (list) {
    property.count_type = TypeOf(words[2], where);
    if (!IsInteger(*property.count_type))
      RefuseHeader("a list whose count is a fraction", where);
  }
  property.type = TypeOf(words[words.size() - 2], where);
  property.name = words.back();
  return property;
}

}  // namespace

size_t SizeOf(PlyType type) { return kTypes[static_cast<size_t>(type)].bytes; }
bool IsInteger(PlyType type) { return type != PlyType::kF32 && type != PlyType::kF64; }

std::optional<size_t> PlyElement::Find(std::string_view property) const {
  const auto found = std::ranges::find(properties, property, &PlyProperty::name);
  if (found == properties.end()) return std::nullopt;
  return static_cast<size_t>(found - properties.begin());
}

uint64_t PlyElement::RowBytes(PlyEncoding encoding) const {
  // A word and what separates it from the next one; the last word may end the file.
  if (encoding == PlyEncoding::kAscii)
    return properties.empty() ? 0 : 2 * properties.size() - 1;
  uint64_t bytes = 0;
  for (const PlyProperty& property : properties)
    bytes += SizeOf(property.count_type.value_or(property.type));
  return bytes;
}

std::optional<size_t> PlyHeader::Find(std::string_view element) const {
  const auto found = std::ranges::find(elements, element, &PlyElement::name);
  if (found == elements.end()) return std::nullopt;
  return static_cast<size_t>(found - elements.begin());
}

bool LooksLikePly(std::string_view bytes) {
  return bytes.starts_with("ply\n") || bytes.starts_with("ply\r\n");
}

PlyHeader ParsePlyHeader(std::string_view bytes, const std::string& where) {
  if (!LooksLikePly(bytes)) RefuseHeader("the first line is not 'ply'", where);
  PlyHeader header;
  header.line_end = bytes[3] == '\r' ? "\r\n" : "\n";
  std::unordered_set<std::string> names, element_names;
  for (size_t at = bytes.find('\n') + 1;;) {
    const size_t end = bytes.substr(0, kMostBytes).find('\n', at);
    if (end == std::string_view::npos) RefuseHeader("it has no end ('end_header')", where);
    std::string_view line = bytes.substr(at, end - at);
    at = end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    const std::vector<std::string> words = WordsOf(line);
    const std::string keyword = words.empty() ? "" : words[0];
    if (header.after_format == 0 && !words.empty() && keyword != "comment" &&
        keyword != "obj_info") {
      if (keyword != "format" || words.size() != 3)
        RefuseHeader("it does not name its encoding", where);
      header.encoding = EncodingOf(words[1], where);
      header.after_format = at;
    } else if (keyword == "comment" || keyword == "obj_info") {
      header.comments.emplace_back(line.substr(line.find(keyword) + keyword.size()));
    } else if (keyword == "element") {
      header.elements.push_back(ElementOf(words, where));
      names.clear();
      if (!element_names.insert(words[1]).second)
        RefuseHeader("the element '" + Printable(words[1]) + "' appears twice", where);
    } else if (keyword == "property") {
      if (header.elements.empty()) RefuseHeader("a property without an element", where);
      header.elements.back().properties.push_back(PropertyOf(words, where));
      if (!names.insert(words.back()).second)
        RefuseHeader("the property '" + Printable(words.back()) + "' appears twice", where);
    } else if (keyword == "end_header") {
      header.bytes = at;
      return header;
    } else if (!words.empty()) {
      RefuseHeader("a line begins with '" + Printable(keyword.substr(0, 40)) + "'", where);
    }
  }
}

}  // namespace regrade
