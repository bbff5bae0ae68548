#include "pipeline/report/assessment.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

// A part of the assessment; `grade` is 1 where nothing is missing, less where it is weak.
struct Part {
  std::string sentence, advice;
  std::optional<double> grade = {};
};

// Detail kept of 0.9 is sharp, and 0.5 soft (SharpnessWord).
Part Sharp(const RunReport& report) {
  const auto& fit = report.stages.reconstruct;
  if (!fit) return {"sharp: not measured", ""};
  const bool held_out = fit->detail_kept_heldout.value.has_value();
  const Metric& kept = held_out ? fit->detail_kept_heldout : fit->detail_kept_train;
  if (!kept.value) return {"sharp: not measured (" + kept.why + ")", ""};
  Part part;
  part.sentence = Format("sharp: %.0f %% of the %sphotos' detail", 100 * *kept.value,
                         held_out ? "" : "fitted ");
  if (!fit->sharpness.empty()) part.sentence += " (" + fit->sharpness + ")";
  part.grade = *kept.value / 0.9;
  part.advice = report.preset == "draft"
                    ? "run again with --preset standard and another --out: its field is finer"
                    : "more photos from nearby, held still, make the scene sharper; --preset "
                      "best has a finer field";
  return part;
}

const ConsistencyMetrics* Nearest(const RunReport& report, const std::string& sequence) {
  const ConsistencyMetrics* found = nullptr;
  for (const ConsistencyMetrics& row : report.evaluation.consistency)
    if (row.sequence == sequence && (found == nullptr || row.gap < found->gap)) found = &row;
  return found;
}

Part Steady(const RunReport& report) {
  const ConsistencyMetrics *styled = Nearest(report, "styled"),
                           *other = Nearest(report, "views_2d");
  const bool frame_by_frame = other != nullptr;
  if (!frame_by_frame) other = Nearest(report, "source");
  if (styled == nullptr || other == nullptr) return {"steady: not measured", ""};
  for (const ConsistencyMetrics* row : {styled, other})
    if (!row->tc_psnr_mean_db.value)
      return {"steady: not measured (" + row->tc_psnr_mean_db.why + ")", ""};
  const double gain = *styled->tc_psnr_mean_db.value - *other->tc_psnr_mean_db.value;
  const std::string than = frame_by_frame ? "frame by frame" : "the scene before styling";
  constexpr double kNoDifference = 0.05;  // below what is printed
  Part part;
  part.sentence = std::abs(gain) < kNoDifference
                      ? "steady: as " + than
                      : Format("steady: %.1f dB %s than %s", std::abs(gain),
                               gain > 0 ? "steadier" : "less steady", than.c_str());
  part.grade = 1 + std::min(0.0, gain) / 3;  // 3 dB twice the squared error
  part.advice = "--scene-wide uses one colour map for all photos, the steadiest there is";
  return part;
}

// PSNR to the 2D method's frames: 30 dB is an error of 8 levels of 255, hard to see.
Part Faithful(const RunReport& report) {
  const auto row = std::ranges::find(report.evaluation.fidelity, std::string("styled"),
                                     &FidelityMetrics::sequence);
  if (row == report.evaluation.fidelity.end()) return {"faithful: not measured", ""};
  const Metric& psnr = row->psnr_to_2d_db;
  if (!psnr.value) return {"faithful: not measured (" + psnr.why + ")", ""};
  Part part;
  part.sentence = Format("faithful: %.1f dB to the recoloured photos, %s", *psnr.value,
                         *psnr.value >= 30   ? "close"
                         : *psnr.value >= 25 ? "mostly close"
                                             : "apart in places");
  part.grade = *psnr.value / 30;
  part.advice =
      "--style-view-weight 0 follows each recoloured photo more closely, and is less steady";
  return part;
}

}  // namespace

std::string Assessment::Line() const { return Join(sentences, "; "); }

Assessment AssessmentOf(const RunReport& report) {
  Assessment assessment;
  const Part* weakest = nullptr;
  const Part parts[] = {Sharp(report), Steady(report), Faithful(report)};
  for (const Part& part : parts) {
    assessment.sentences.push_back(part.sentence);
    if (part.grade && *part.grade < 1 && (weakest == nullptr || *part.grade < *weakest->grade))
      weakest = &part;
  }
  assessment.advice = weakest != nullptr
                          ? weakest->advice
                          : "nothing is weak; `regrade render` makes larger and longer films "
                            "(--film-size, --film-seconds)";
  return assessment;
}

}  // namespace regrade
