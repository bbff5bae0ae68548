// Which records of a field's file are in memory, for files that lie beside it by record.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace regrade {

struct KeptRecords {
  int64_t of = 0;             // records of the file
  std::vector<int64_t> kept;  // ascending
  bool all = true;            // and `kept` is empty

  // Rows of `values` [of] for what is kept.
  template <typename T>
  std::vector<T> Pick(std::vector<T> values) const {
    if (all || values.empty()) return values;
    std::vector<T> picked;
    picked.reserve(kept.size());
    for (const int64_t i : kept) picked.push_back(values[static_cast<size_t>(i)]);
    return picked;
  }
};

}  // namespace regrade
