#include "pipeline/program/nearest_name.h"

#include <algorithm>

namespace regrade {

int EditDistance(const std::string& a, const std::string& b) {
  // Optimal string alignment: three rows of the table suffice.
  std::vector<int> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) last[j] = static_cast<int>(j);
  for (size_t i = 1; i <= a.size(); ++i) {
    row[0] = static_cast<int>(i);
    for (size_t j = 1; j <= b.size(); ++j) {
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
    std::swap(before, last);
    std::swap(last, row);
  }
  return last[b.size()];
}

std::string NearestName(const std::string& typed, const std::vector<std::string>& names) {
  std::string nearest;
  int fewest = std::max(2, static_cast<int>(typed.size()) / 3) + 1;
  if (typed.size() > 200) return nearest;  // not a typing mistake
  for (const std::string& name : names) {
    const bool begins = typed.size() >= 3 && name.starts_with(typed);
    const int edits = begins ? 1 : EditDistance(typed, name);
    if (edits < fewest) {
      fewest = edits;
      nearest = name;
    }
  }
  return nearest;
}

}  // namespace regrade
