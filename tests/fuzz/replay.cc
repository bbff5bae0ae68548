// Inputs as text, and what the process has taken.
#include "tests/fuzz/replay.h"

#include <sys/resource.h>

namespace regrade::testing {
namespace {

constexpr size_t kShown = 300;  // bytes of an input that a failure shows

}  // namespace

std::string Hex(const std::string& bytes) {
  std::string text;
  char two[3];
  for (const char c : bytes.substr(0, kShown)) {
    std::snprintf(two, sizeof two, "%02x", static_cast<unsigned char>(c));
    text += two;
  }
  return text + (bytes.size() > kShown ? "..." : "");
}

std::string FromHex(const std::string& text) {
  std::string bytes, digits;
  bool words = false;
  for (const char c : text) {
    words = c != '\n' && (words || c == '#');
    if (words || std::string_view(" \n\r").find(c) != std::string_view::npos) continue;
    digits += c;
    if (digits.size() < 2) continue;
    bytes += static_cast<char>(std::stoi(digits, nullptr, 16));
    digits.clear();
  }
  return bytes;
}

long PeakMemory() {
  rusage usage;
  ::getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss >> 10;
}

}  // namespace regrade::testing
