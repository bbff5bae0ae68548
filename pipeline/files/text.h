// Text: UTF-8, durations, splitting and joining.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

struct CodePoint {
  uint32_t value = 0;
  size_t bytes = 0;  // 0: the text does not begin with valid UTF-8
};

// The first character of a text that is not empty.
CodePoint FirstCodePoint(std::string_view text);

// The text with control characters and invalid UTF-8 written as \xNN, so that a file name
// cannot steer a terminal.
std::string Printable(std::string_view text);
// The same, with line breaks kept where two spaces follow: lists and other programs' output
// are indented so.
std::string PrintableLines(std::string_view text);

// "2 h 03 min", "4 min 12 s", "8 s".
std::string DurationText(double seconds);

// "1 photo", "3 photos"; `things` where the plural is not that with an s.
std::string Counted(int64_t count, const std::string& thing, const std::string& things = "");

// Parts between separators, empty ones included: at least one.
std::vector<std::string> Split(std::string_view text, char separator);
std::string Join(const std::vector<std::string>& parts, std::string_view separator);

// In lines of at most `width` columns, of which later ones are indented; the first begins at
// column `indent`, too.
std::string Wrapped(const std::string& text, size_t indent, size_t width);

// Of ASCII letters.
std::string LowerCase(std::string text);

// ".jpg" of "a/b.JPG"; empty for a name without one.
std::string LowerExtension(const std::string& path);

}  // namespace regrade
