// Numbers in texts of other programs, and the mark that may stand before such a text.
#pragma once

#include <charconv>
#include <string_view>

namespace regrade {

// The text without the byte-order mark that some editors write before UTF-8.
inline std::string_view WithoutByteOrderMark(std::string_view text) {
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  return text;
}

// Reads all of `word` as a number. A plus may stand before it, which std::from_chars refuses.
// False for anything else, and for a number out of T's range.
template <typename T>
bool ParseNumber(std::string_view word, T* value) {
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  const char* const end = word.data() + word.size();
  const auto [stop, error] = std::from_chars(word.data(), end, *value);
  return error == std::errc() && stop == end;
}

}  // namespace regrade
