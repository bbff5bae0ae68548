#include "pipeline/commands/frame_numbers.h"

#include <algorithm>
#include <cctype>

namespace regrade {
namespace {

constexpr size_t kMostDigits = 18;  // of an int64_t; longer runs are text

bool IsDigit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

// A name's runs of digits, and its text with one mark for each of them.
struct ParsedName {
  std::string text;
  std::vector<FrameNumber> runs;
};

ParsedName Parse(const std::string& name) {
  ParsedName parsed;
  const std::string stem = FrameStem(name);
  for (size_t begin = 0; begin < stem.size();) {
    size_t end = begin;
    while (end < stem.size() && IsDigit(stem[end])) ++end;
    const size_t digits = end - begin;
    if (digits > 0 && digits <= kMostDigits) {
      parsed.runs.push_back({std::stoll(stem.substr(begin, digits)), digits});
      parsed.text += '\0';
    } else {
      end = std::max(end, begin + 1);
      parsed.text += stem.substr(begin, end - begin);
    }
    begin = end;
  }
  return parsed;
}

std::vector<FrameNumber> Column(const std::vector<ParsedName>& names, size_t column) {
  std::vector<FrameNumber> numbers;
  for (const ParsedName& name : names) numbers.push_back(name.runs[column]);
  return numbers;
}

bool Varies(const std::vector<FrameNumber>& numbers) {
  return std::ranges::any_of(
      numbers, [&](const FrameNumber& n) { return n.number != numbers.front().number; });
}

bool Increases(const std::vector<FrameNumber>& numbers) {
  return std::ranges::is_sorted(numbers, std::less_equal<>(), &FrameNumber::number);
}

}  // namespace

std::string FrameStem(const std::string& name) {
  const size_t dot = name.rfind('.'), folder = name.rfind('/');
  const size_t begin = folder == std::string::npos ? 0 : folder + 1;
  if (dot == std::string::npos || dot <= begin) return name;
  const bool letters = std::any_of(name.begin() + static_cast<std::ptrdiff_t>(dot) + 1,
                                   name.end(), [](char c) { return !IsDigit(c); });
  return letters ? name.substr(0, dot) : name;
}

std::vector<FrameNumber> FrameNumbers(const std::vector<std::string>& names) {
  std::vector<ParsedName> parsed;
  for (const std::string& name : names) {
    parsed.push_back(Parse(name));
    if (parsed.back().runs.empty() || parsed.back().text != parsed.front().text) return {};
  }
  if (parsed.empty()) return {};
  std::vector<size_t> varying;
  const size_t runs = parsed.front().runs.size();
  for (size_t c = 0; c < runs; ++c)
    if (Varies(Column(parsed, c))) varying.push_back(c);
  if (varying.empty()) return Column(parsed, runs - 1);
  if (varying.size() == 1) return Column(parsed, varying[0]);
  for (const size_t c : varying)
    if (Increases(Column(parsed, c))) return Column(parsed, c);
  return {};
}

std::string PaddedNumber(int64_t number, size_t digits) {
  const std::string text = std::to_string(number);
  return std::string(digits > text.size() ? digits - text.size() : 0, '0') + text;
}

}  // namespace regrade
