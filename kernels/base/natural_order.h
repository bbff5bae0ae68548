// Natural order of file names: "view2" comes before "view10".
#pragma once

#include <string_view>

namespace regrade {

// A strict total order of byte strings. Runs of digits compare by value, at any length; ASCII
// letters compare without case; '/' comes first, so that a folder's files stay together. Names
// that are equal by these rules ("a1", "A01") are ordered by their bytes.
inline bool NaturalLess(std::string_view a, std::string_view b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto rank = [](char c) -> int {
    if (c == '/') return 0;
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return static_cast<unsigned char>(c) + 1;
  };
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (digit(a[i]) && digit(b[j])) {
      while (i < a.size() && a[i] == '0') ++i;
      while (j < b.size() && b[j] == '0') ++j;
      size_t end_a = i, end_b = j;
      while (end_a < a.size() && digit(a[end_a])) ++end_a;
      while (end_b < b.size() && digit(b[end_b])) ++end_b;
      if (end_a - i != end_b - j) return end_a - i < end_b - j;
      if (const int order = a.substr(i, end_a - i).compare(b.substr(j, end_b - j)))
        return order < 0;
      i = end_a;
      j = end_b;
    } else {
      if (rank(a[i]) != rank(b[j])) return rank(a[i]) < rank(b[j]);
      ++i;
      ++j;
    }
  }
  if (i < a.size() || j < b.size()) return j < b.size();
  return a < b;
}

}  // namespace regrade
