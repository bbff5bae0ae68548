// Bounds that a user demands of measured metrics (--require), for other people's CI.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/report/data.h"

namespace regrade {

// "styled:tc-psnr:1>=30": a sequence of frames or a stage, a metric as in report.json without
// its ending _db or _mean_db, for consistency a gap, and a bound.
struct Requirement {
  std::string text;             // as the user wrote it
  std::string subject, metric;  // with _ for -
  std::optional<int> gap;
  bool at_least = true;  // else at most
  double bound = 0;
};

// Requirements separated by commas; none for an empty text. Throws Error(kUsage) for what is no
// requirement, and for a sequence, stage, metric or gap that no evaluation with `gaps` has.
std::vector<Requirement> ParseRequirements(const std::string& text,
                                           const std::vector<int>& gaps);

// A sentence for each requirement that does not hold, with the measured value and the bound. A
// missing metric or one that is not a number holds none; an infinite one holds ">=".
std::vector<std::string> FailedRequirements(const std::vector<Requirement>& requirements,
                                            const RunReport& report);

// Throws Error(kRequirement) with all sentences, unless there are none.
void ThrowIfAny(const std::vector<std::string>& failed);

}  // namespace regrade
