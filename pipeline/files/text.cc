#include "pipeline/files/text.h"

#include <utf8cpp/utf8.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"

namespace regrade {

CodePoint FirstCodePoint(std::string_view text) {
  const char* at = text.data();
  // At most four bytes: an invalid one later in the text does not matter.
  const char* const end = at + std::min<size_t>(text.size(), 4);
  try {
    const uint32_t value = utf8::next(at, end);
    return {value, static_cast<size_t>(at - text.data())};
  } catch (const utf8::exception&) {
    return {};
  }
}

std::string Printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const CodePoint c = FirstCodePoint(text);
    const bool control = c.value < 0x20 || (c.value >= 0x7f && c.value < 0xa0);
    if (c.bytes > 0 && !control) {
      result += text.substr(0, c.bytes);
      text.remove_prefix(c.bytes);
      continue;
    }
    result += Format("\\x%02x", static_cast<unsigned char>(text[0]));
    text.remove_prefix(1);
  }
  return result;
}

std::string PrintableLines(std::string_view text) {
  constexpr std::string_view kBreak = "\n  ";
  std::string result;
  for (size_t begin = 0; begin <= text.size();) {
    const size_t end = std::min(text.find(kBreak, begin), text.size());
    result += Printable(text.substr(begin, end - begin));
    if (end == text.size()) break;
    result += kBreak;
    begin = end + kBreak.size();
  }
  return result;
}

std::string DurationText(double seconds) {
  const long long whole = std::llround(std::min(seconds, 1e15));
  if (whole >= 3600) return Format("%lld h %02lld min", whole / 3600, whole / 60 % 60);
  if (whole >= 60) return Format("%lld min %02lld s", whole / 60, whole % 60);
  return Format("%lld s", whole);
}

std::string Counted(int64_t count, const std::string& thing, const std::string& things) {
  return std::to_string(count) + " " +
         (count == 1       ? thing
          : things.empty() ? thing + "s"
                           : things);
}

std::vector<std::string> Split(std::string_view text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text)
    if (c == separator)
      parts.emplace_back();
    else
      parts.back() += c;
  return parts;
}

std::string Join(const std::vector<std::string>& parts, std::string_view separator) {
  std::string text;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (i > 0) text += separator;
    text += parts[i];
  }
  return text;
}

std::string Wrapped(const std::string& text, size_t indent, size_t width) {
  std::string result;
  size_t column = indent;
  for (const std::string& word : Split(text, ' ')) {
    if (word.empty()) continue;
    if (column + word.size() + 1 > width && column > indent) {
      result += "\n" + std::string(indent, ' ');
      column = indent;
    }
    result += (column > indent ? " " : "") + word;
    column += word.size() + (column > indent ? 1 : 0);
  }
  return result;
}

std::string LowerCase(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::string LowerExtension(const std::string& path) {
  return LowerCase(std::filesystem::path(path).extension().string());
}

}  // namespace regrade
