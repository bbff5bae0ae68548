// Mutations and their frequencies: mostly small ones, so that mutants pass a reader's first
// checks.
#include "tests/fuzz/mutate.h"

#include <algorithm>
#include <cctype>
#include <cstddef>

namespace regrade::testing {
namespace {

constexpr size_t kLongest = 1 << 20;

void SetEdge(std::string* bytes, FuzzRandom* random) {
  const size_t width = size_t{1} << random->Below(4);
  if (bytes->size() < width) return;
  size_t at = random->Below(bytes->size() - width + 1);
  if (random->Chance(0.5)) at -= at % width;
  const bool big = random->Chance(0.3);
  uint64_t value = 0;
  const auto place = [&](size_t i) { return at + (big ? width - 1 - i : i); };
  for (size_t i = width; i-- > 0;)
    value = value << 8 | static_cast<unsigned char>((*bytes)[place(i)]);
  switch (random->Below(6)) {
    case 0:
      value += random->Below(5) - 2;
      break;
    case 1:
      value = random->Below(3);
      break;
    case 2:
      value = (uint64_t{1} << random->Below(64)) - random->Below(2);
      break;
    case 3:
      value = ~uint64_t{0} - random->Below(3);
      break;
    case 4:
      value ^= uint64_t{1} << random->Below(8 * width);
      break;
    default:
      value = random->Bits();
  }
  for (size_t i = 0; i < width; ++i, value >>= 8) (*bytes)[place(i)] = static_cast<char>(value);
}

// A piece [begin, begin + length), mostly short.
void AnyPiece(const std::string& bytes, FuzzRandom* random, size_t* begin, size_t* length) {
  *begin = random->Below(bytes.size());
  const size_t left = bytes.size() - *begin;
  *length = 1 + random->Below(random->Chance(0.7) ? std::min<size_t>(left, 32) : left);
}

void ChangeBytes(std::string* bytes, FuzzRandom* random) {
  if (bytes->empty()) {
    bytes->append(1 + random->Below(16), static_cast<char>(random->Bits()));
    return;
  }
  size_t begin, length;
  AnyPiece(*bytes, random, &begin, &length);
  const size_t kind = random->Below(12);
  if (kind < 6) {
    SetEdge(bytes, random);
  } else if (kind < 8) {
    (*bytes)[begin] = static_cast<char>((*bytes)[begin] ^ (1 << random->Below(8)));
  } else if (kind == 8) {
    bytes->erase(begin, length);
  } else if (kind == 9) {
    bytes->insert(random->Below(bytes->size()), bytes->substr(begin, length));
  } else if (kind == 10) {
    bytes->resize(begin);
  } else {
    bytes->insert(begin, length,
                  random->Chance(0.5) ? '\0' : static_cast<char>(random->Bits()));
  }
}

bool InNumber(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '+' || c == '.' ||
         c == 'e' || c == 'E';
}

void SetNumber(std::string* text, FuzzRandom* random) {
  static const std::vector<std::string> kNumbers = {"0",
                                                    "-0",
                                                    "-1",
                                                    "1",
                                                    "0.5",
                                                    "1e-310",
                                                    "1e308",
                                                    "-1e308",
                                                    "1e999",
                                                    "nan",
                                                    "inf",
                                                    "-inf",
                                                    "2147483647",
                                                    "2147483648",
                                                    "4294967296",
                                                    "9223372036854775807",
                                                    "18446744073709551615",
                                                    "18446744073709551616",
                                                    "1e18",
                                                    "0x10",
                                                    "1.",
                                                    ".5",
                                                    "--1",
                                                    "1e",
                                                    "007",
                                                    "16777217",
                                                    "65536",
                                                    "4611686018427387904"};
  const size_t from = random->Below(text->size());
  const auto begin =
      std::find_if(text->begin() + static_cast<std::ptrdiff_t>(from), text->end(),
                   [](char c) { return std::isdigit((unsigned char)c) != 0; });
  if (begin == text->end()) return;
  size_t first = static_cast<size_t>(begin - text->begin()), last = first;
  while (first > 0 && InNumber((*text)[first - 1])) --first;
  while (last < text->size() && InNumber((*text)[last])) ++last;
  text->replace(first, last - first, kNumbers[random->Below(kNumbers.size())]);
}

// From one separator to another one.
void AnyItem(const std::string& text, FuzzRandom* random, size_t* begin, size_t* length) {
  constexpr const char* kSeparators = ",\n{}[]() :;\t\0";
  *begin = random->Below(text.size());
  while (*begin > 0 &&
         std::string_view(kSeparators).find(text[*begin - 1]) == std::string_view::npos)
    --*begin;
  size_t end = *begin;
  for (size_t separators = 1 + random->Below(4); separators > 0 && end < text.size();
       --separators)
    end = std::min(text.find_first_of(kSeparators, end + 1), text.size());
  *length = std::max<size_t>(1, end - *begin);
}

void ChangeText(std::string* text, const std::vector<std::string>& dictionary,
                FuzzRandom* random) {
  if (text->empty()) {
    *text = dictionary[random->Below(dictionary.size())];
    return;
  }
  size_t begin, length;
  AnyItem(*text, random, &begin, &length);
  const size_t place = random->Below(text->size() + 1), kind = random->Below(12);
  if (kind < 4) {
    SetNumber(text, random);
  } else if (kind < 6) {
    text->insert(place, dictionary[random->Below(dictionary.size())]);
  } else if (kind == 6) {
    text->replace(begin, length, dictionary[random->Below(dictionary.size())]);
  } else if (kind == 7) {
    text->erase(begin, length);
  } else if (kind == 8) {
    text->insert(begin, text->substr(begin, length));
  } else if (kind == 9) {
    const std::string item = text->substr(begin, length);
    text->erase(begin, length);
    text->insert(random->Below(text->size() + 1), item);
  } else if (kind == 10) {
    const char bracket = "[{(\"'<"[random->Below(6)];
    text->insert(place, random->Chance(0.2) ? 1 + random->Below(20000) : 1, bracket);
  } else {
    ChangeBytes(text, random);
  }
}

}  // namespace

std::string MutateBytes(std::string bytes, FuzzRandom* random) {
  for (size_t changes = 1 + random->Below(random->Chance(0.8) ? 2 : 6); changes > 0; --changes)
    ChangeBytes(&bytes, random);
  if (bytes.size() > kLongest) bytes.resize(kLongest);
  return bytes;
}

std::string MutateText(std::string text, const std::vector<std::string>& dictionary,
                       FuzzRandom* random) {
  for (size_t changes = 1 + random->Below(random->Chance(0.8) ? 2 : 6); changes > 0; --changes)
    ChangeText(&text, dictionary, random);
  if (text.size() > kLongest) text.resize(kLongest);
  return text;
}

std::string MutateJson(std::string text, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"{",
                                                  "}",
                                                  "[",
                                                  "]",
                                                  ":",
                                                  ",",
                                                  "null",
                                                  "true",
                                                  "false",
                                                  "\"\"",
                                                  "\"\\ud800\"",
                                                  "\"\\u0000\"",
                                                  "\xff",
                                                  "\xef\xbb\xbf",
                                                  "// x\n",
                                                  "\"frames\"",
                                                  "\"w\":",
                                                  "\"fl_x\":",
                                                  "\"k4\":",
                                                  "\"camera_angle_x\":",
                                                  "\"camera_model\":",
                                                  "\"OPENCV_FISHEYE\"",
                                                  "\"is_fisheye\":",
                                                  "\"file_path\":",
                                                  "\"0.png\"",
                                                  "\"../1\"",
                                                  "\"transform_matrix\":",
                                                  "\"options\":",
                                                  "\"arguments\":",
                                                  "\"schema\":",
                                                  "\"width\":",
                                                  "\"seed\":",
                                                  "\"out\":"};
  return MutateText(std::move(text), kWords, random);
}

}  // namespace regrade::testing
