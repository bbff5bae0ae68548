// Escapes untrusted text, such as file names, for HTML and formats numbers.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace regrade {

// Text for HTML, in an element or in a quoted attribute. Control bytes, bytes that are not
// UTF-8 and characters that reorder or hide text are written as "\x1b", "\u{202e}".
std::string EscapeHtml(std::string_view text);

// One line that a POSIX shell splits into exactly these arguments.
std::string ShellCommand(const std::vector<std::string>& arguments);

// RFC 4648, with padding, on one line.
std::string Base64(std::string_view bytes);

// "12.34" with `decimals` after the point, whatever the locale; "-0.00" is written "0.00".
std::string FixedNumber(double value, int decimals);

// "1,234,567".
std::string GroupedNumber(int64_t value);

// "0.8 s", "42 s", "3 min 07 s", "2 h 05 min".
std::string Duration(double seconds);

}  // namespace regrade
