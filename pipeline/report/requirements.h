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

// Requirements separated by commas; none for an empty text. `styled`: how many sequences
// styled, styled_2, ... there are. Throws Error(kUsage) for what is no requirement, and for a
// sequence, stage, metric or gap that no evaluation with `gaps` has.
std::vector<Requirement> ParseRequirements(const std::string& text,
                                           const std::vector<int>& gaps, int styled = 1);

// A requirement with what was measured.
struct CheckedRequirement {
  Requirement wanted;
  Metric measured;
  bool holds = false;
  std::string of;  // the style, where a run may have several

  // "style: styled:tc-psnr:1>=30: measured 31.5", or why there is no number.
  std::string Sentence() const;
};

// One for each requirement, in their order. A missing metric or one that is not a number holds
// none; an infinite one holds ">=".
std::vector<CheckedRequirement> CheckRequirements(const std::vector<Requirement>& requirements,
                                                  const RunReport& report,
                                                  const std::string& of = "");

}  // namespace regrade
