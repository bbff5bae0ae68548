#include "pipeline/report/assessment.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// A part of the assessment; `grade` is 1 where nothing is missing, less where it is weak.
struct Part {
  std::string sentence, advice;
  std::optional<double> grade = {};
};

bool OptionIs(const RunReport& report, const std::string& name, const std::string& value) {
  return std::ranges::any_of(report.options, [&](const OptionValue& option) {
    return option.name == name && option.value == value;
  });
}

// A LUT, which is what `regrade retouch` makes of an edit, is one map for all photos already.
bool IsOneMap(const RunReport& report) {
  return (report.stages.style_2d && report.stages.style_2d->method == kLutMethod) ||
         OptionIs(report, "scene-wide", "true");
}

// The next finer preset; empty for the finest and for those that follow the papers.
std::string FinerPreset(const std::string& preset) {
  return preset == "smoke"      ? "draft"
         : preset == "draft"    ? "standard"
         : preset == "standard" ? "best"
                                : "";
}

std::string RunAgain(const std::string& preset) {
  return "run again with --preset " + FinerPreset(preset) + " and another --out";
}

// "photos are far apart: add some between 00.png and 02.png; 01.png was not placed".
std::string MorePhotos(const PhotoSpacing& spacing) {
  constexpr size_t kMostNames = 3;
  std::string text = spacing.far_apart() ? "photos are far apart: add some" : "add photos";
  if (!spacing.before.empty())
    text += (spacing.far_apart() ? " between " : ", most of all between ") + spacing.before +
            " and " + spacing.after;
  const std::vector<std::string>& lost = spacing.not_placed;
  if (lost.empty()) return text;
  const size_t named = std::min(lost.size(), kMostNames);
  text += "; " + Join({lost.begin(), lost.begin() + static_cast<long>(named)}, ", ");
  if (named < lost.size()) text += Concat(" and ", lost.size() - named, " more");
  return text + (lost.size() == 1 ? " was not placed" : " were not placed");
}

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
  const std::string finer = FinerPreset(report.preset);
  part.advice = report.preset == "draft"
                    ? RunAgain(report.preset) + ": its field is finer"
                    : "more photos from nearby, held still, make the scene sharper" +
                          (finer.empty() ? "" : "; --preset " + finer + " has a finer field");
  if (LacksPhotos(*fit) && report.spacing) part.advice = MorePhotos(*report.spacing);
  return part;
}

const ConsistencyMetrics* Nearest(const RunReport& report, const std::string& sequence) {
  const ConsistencyMetrics* found = nullptr;
  for (const ConsistencyMetrics& row : report.evaluation.consistency)
    if (row.sequence == sequence && (found == nullptr || row.gap < found->gap)) found = &row;
  return found;
}

// Of the film; one along the photos' places (--path views) has no frames of its own. Without a
// film (--no-films) of the photos' places.
Part Steady(const RunReport& report) {
  const bool film = !report.stages.render || report.stages.render->film_frames > 0;
  const bool own_frames = report.stages.render && report.stages.render->path_frames > 0;
  const auto of_film = [&](const char* sequence) {
    return Nearest(report, (own_frames ? kPathPrefix : "") + std::string(sequence));
  };
  const ConsistencyMetrics *styled = of_film("styled"), *other = of_film("views_2d");
  const bool frame_by_frame = other != nullptr;
  if (!frame_by_frame) other = of_film("source");
  if (styled == nullptr || other == nullptr) return {"steady: not measured", ""};
  if (styled->tc_psnr_mean_db.infinite)
    return {film ? "steady: nothing of the film flickers" : "steady: nothing flickers", "", 1};
  for (const ConsistencyMetrics* row : {styled, other})
    if (!row->tc_psnr_mean_db.value)
      return {"steady: not measured (" + row->tc_psnr_mean_db.why + ")", ""};
  const double gain = *styled->tc_psnr_mean_db.value - *other->tc_psnr_mean_db.value;
  const std::string than = frame_by_frame ? "frame by frame" : "the scene before styling";
  constexpr double kNoDifference = 0.05;  // below what is printed
  Part part;
  part.sentence = film ? "steady: the film is " : "steady: neighbouring views are ";
  part.sentence += std::abs(gain) < kNoDifference
                       ? "as steady as " + than
                       : Format("%.1f dB %s than %s", std::abs(gain),
                                gain > 0 ? "steadier" : "less steady", than.c_str());
  part.grade = 1 + std::min(0.0, gain) / 3;  // 3 dB twice the squared error
  part.advice = IsOneMap(report)
                    ? "--strength 0.7 applies less of the style, which is steadier"
                    : "--scene-wide uses one colour map for all views, the steadiest there is";
  return part;
}

// PSNR to the 2D method's frames: 30 dB is an error of 8 levels of 255, hard to see.
Part Faithful(const RunReport& report) {
  const auto row = std::ranges::find(report.evaluation.fidelity, std::string("styled"),
                                     &FidelityRow::sequence);
  if (row == report.evaluation.fidelity.end()) return {"faithful: not measured", ""};
  const Metric psnr(row->psnr_to_2d_db);
  if (psnr.infinite) return {"faithful: exactly the recoloured views", "", 1};
  if (!psnr.value) return {"faithful: not measured (" + psnr.why + ")", ""};
  const auto& evaluate = report.stages.evaluate;
  const bool edit = evaluate && evaluate->edit_seen;
  Part part;
  part.sentence = Format("faithful: %.1f dB to the %s, %s", *psnr.value,
                         edit ? "edit where its photo sees the scene" : "recoloured views",
                         *psnr.value >= 30   ? "close"
                         : *psnr.value >= 25 ? "mostly close"
                                             : "apart in places");
  part.grade = *psnr.value / 30;
  part.advice = edit ? "edit a photo that shows more of what is to change, seen from nearby"
                     : "--config '{\"style-view-weight\": 0}' follows each recoloured view "
                       "more closely, and is less steady";
  return part;
}

}  // namespace

bool LacksPhotos(const ReconstructReport& fit) {
  // Captures of 20 photos and more lose up to 3 dB; those of a dozen 5 to 13.
  constexpr double kFarBelowDb = 5, kDetailLeft = 0.6;
  const auto &train_db = fit.psnr_train_db.value, &held_out_db = fit.psnr_heldout_db.value,
             &train = fit.detail_kept_train.value, &held_out = fit.detail_kept_heldout.value;
  return (train_db && held_out_db && *held_out_db < *train_db - kFarBelowDb) ||
         (train && held_out && *held_out < kDetailLeft * *train);
}

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
  if (report.preset == "smoke")
    assessment.advice = "smoke only shows that everything runs: " + RunAgain(report.preset);
  return assessment;
}

}  // namespace regrade
