#include "reconstruct/colmap/colmap_output.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "kernels/base/quantile.h"

namespace regrade {
namespace {

// Reads numbers after `key`, anywhere in the line (newer versions print a timestamp first).
// Returns the count of numbers read.
template <typename... Numbers>
int Scan(const std::string& line, const char* key, const char* format, Numbers... numbers) {
  const size_t position = line.find(key);
  if (position == std::string::npos) return 0;
  return std::sscanf(line.c_str() + position + std::string(key).size(), format, numbers...);
}

}  // namespace

int ColmapEvidence::MedianFeatures() const {
  std::vector<int> counts;
  for (const auto& [name, count] : features) counts.push_back(count);
  return Median(std::move(counts));
}

void ColmapOutput::Line(const std::string& line) {
  int i = 0, n = 0, j = 0, m = 0;
  if (Scan(line, "Processed file [", "%d/%d", &i, &n) == 2 ||
      Scan(line, "Matching image [", "%d/%d", &i, &n) == 2) {
    if (n > 0) fraction_ = std::max(fraction_, static_cast<double>(i) / n);
  } else if (Scan(line, "Matching block [", "%d/%d, %d/%d", &i, &n, &j, &m) == 4) {
    if (n > 0 && m > 0)
      fraction_ = std::max(fraction_, ((i - 1.0) * m + j) / (static_cast<double>(n) * m));
  } else if (Scan(line, "Registering image #", "%d (%d)", &i, &n) == 2) {
    if (num_photos_ > 0) fraction_ = std::max(fraction_, static_cast<double>(n) / num_photos_);
  } else if (Scan(line, "Loading matches... ", "%d", &n) == 1) {
    evidence_.matched_pairs = n;
  } else if (char name[4096]; Scan(line, "  Name: ", " %4095[^\n]", name) == 1) {
    name_ = name;
    evidence_.features[name_] = 0;
  } else if (Scan(line, "  Features: ", "%d", &n) == 1 && !name_.empty()) {
    evidence_.features[name_] = n;
  }
  fraction_ = std::min(fraction_, 1.0);
}

}  // namespace regrade
