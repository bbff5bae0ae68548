#include "pipeline/capture/number_file.h"

#include <cmath>
#include <string_view>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr uint64_t kMostNumberBytes = 64 << 10;
constexpr char kBetween[] = " \t\r,";

double NumberOf(std::string_view word, const std::string& where) {
  double value = 0;
  if (!ParseNumber(word, &value) || !std::isfinite(value))
    throw InputError("'" + Printable(word.substr(0, 40)) + "' is not a number", where,
                     "the file is damaged, or was written by another program");
  return value;
}

}  // namespace

std::vector<std::vector<double>> ReadNumberFile(const std::string& path) {
  const std::string text = ReadWholeFile(path, kMostNumberBytes);
  std::vector<std::vector<double>> lines;
  int number = 0;
  for (const std::string& line : Split(WithoutByteOrderMark(text), '\n')) {
    ++number;
    std::vector<double> values;
    for (size_t at = line.find_first_not_of(kBetween); at != std::string::npos;) {
      const size_t end = std::min(line.find_first_of(kBetween, at), line.size());
      values.push_back(NumberOf(std::string_view(line).substr(at, end - at),
                                path + ":" + std::to_string(number)));
      at = line.find_first_not_of(kBetween, end);
    }
    if (!values.empty()) lines.push_back(std::move(values));
  }
  if (lines.empty()) throw InputError("holds no numbers", path);
  return lines;
}

}  // namespace regrade
