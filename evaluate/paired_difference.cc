#include "evaluate/paired_difference.h"

#include <cmath>
#include <map>
#include <numeric>
#include <vector>

namespace regrade {
namespace {

// The value of each pair, by its first frame, of a sequence and gap.
using PairValues = std::map<int, double>;

template <typename Pair, typename Value>
PairValues ValuesOf(const std::vector<Pair>& pairs, const std::string& sequence, int gap,
                    const Value& value_of) {
  PairValues values;
  for (const Pair& pair : pairs) {
    if (pair.sequence != sequence || pair.to - pair.from != gap) continue;
    const std::optional<double> value = value_of(pair);
    if (value && std::isfinite(*value)) values[pair.from] = *value;
  }
  return values;
}

PairedDifference Difference(const PairValues& of, const PairValues& to, int gap) {
  std::vector<double> differences;  // in order of time
  for (const auto& [from, value] : of)
    if (const auto other = to.find(from); other != to.end())
      differences.push_back(value - other->second);
  PairedDifference difference;
  difference.pairs = static_cast<int>(differences.size());
  if (differences.empty()) return difference;
  difference.mean = std::accumulate(differences.begin(), differences.end(), 0.0) /
                    static_cast<double>(differences.size());
  difference.interval = BootstrapMean(differences, gap);
  return difference;
}

template <typename Row, typename Pair, typename Value>
void AddTo(std::vector<Row>* rows, const std::vector<Pair>& pairs, const std::string& sequence,
           const Value& value_of) {
  for (Row& row : *rows)
    if (row.sequence != sequence)
      row.difference = Difference(ValuesOf(pairs, row.sequence, row.gap, value_of),
                                  ValuesOf(pairs, sequence, row.gap, value_of), row.gap);
}

}  // namespace

void AddDifferences(const std::string& sequence, ConsistencyReport* report) {
  report->compared_with = sequence;
  AddTo(&report->rows, report->pairs, sequence,
        [](const PairResult& pair) { return pair.psnr_db; });
  AddTo(&report->warped, report->warped_pairs, sequence,
        [](const WarpedPair& pair) { return pair.corrected.rmse; });
}

}  // namespace regrade
