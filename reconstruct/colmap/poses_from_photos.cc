// Tries one strategy after the other until enough photos are registered. Then refines and
// checks the best model. Where its lens is implausible, maps again with simpler lenses. Refuses
// with a reason.
#include "reconstruct/colmap/poses_from_photos.h"

#include <algorithm>
#include <filesystem>
#include <optional>

#include "kernels/base/error.h"
#include "reconstruct/colmap/attempt_runner.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/photo_statuses.h"
#include "reconstruct/colmap/refine_intrinsics.h"
#include "reconstruct/colmap/simpler_lens.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr double kGoodFraction = 0.95;  // of the photos: enough to stop

// Of fewer photos, some lens makes a model of photos that only turn.
constexpr size_t kFewestForASimplerLens = 5;

class PoseFinder {
 public:
  PoseFinder(const std::vector<StagedPhoto>& photos, const PoseOptions& options,
             const std::string& work_folder, const ProgressFunction& progress,
             PoseReport* report)
      : photos_(photos),
        options_(options),
        work_folder_(work_folder),
        progress_(progress),
        report_(*report) {
    limits_.min_views = options.min_photos;
  }

  Capture Find(const std::string& sparse_output_folder) {
    CheckPhotos();
    runner_.emplace(photos_, options_, work_folder_, progress_, &report_);
    AttemptResult best = TryStrategies();
    if (best.models.empty())
      Refuse(WhyNoModel(best.evidence), photos_.size(), options_.min_photos);
    RefinedModel refined;
    Capture capture;
    do {
      refined = runner_->Refine(best);
      capture = CaptureFromModel(refined.model, photos_);
    } while (Simplify(AssessScene(capture, limits_).lens, &best));
    capture.models_found = static_cast<int>(best.models.size());
    ExplainUnregistered(best, photos_, &capture);
    Check(capture);
    Describe(best, refined);
    CopyModel(refined.folder, sparse_output_folder);
    return capture;
  }

 private:
  void CheckPhotos() {
    if (photos_.empty())
      throw Error(ExitCode::kInput, "there are no photos", "", "give a folder with photos");
    if (photos_.size() == 1)
      throw Error(ExitCode::kScene, "one photo shows no depth", photos_.front().file,
                  "take 20 to 60 photos, stepping sideways between them");
    const fs::path folder = fs::path(photos_.front().path).parent_path();
    for (const StagedPhoto& photo : photos_)
      REGRADE_CHECK_EQ(fs::path(photo.path), folder / photo.name);
  }

  // The best attempt, or the last one without models.
  AttemptResult TryStrategies() {
    std::vector<PoseStrategy> strategies = PoseStrategies(photos_, options_.all_pairs_up_to);
    // Too few photos are refused in any case; one attempt finds further problems.
    if (TooFewGiven()) strategies.resize(1);
    AttemptResult best;
    const PoseStrategy* last = nullptr;  // the previous one, if it found all features
    for (const PoseStrategy& strategy : strategies) {
      if (last != nullptr && IsSameSearch(*last, strategy)) continue;
      std::optional<AttemptResult> attempt;
      try {
        attempt = runner_->Run(strategy, report_.attempts.size() + 1);
        Record(*attempt);
        while (!attempt->models.empty() && Simplify(attempt->models.front().lens, &*attempt)) {
        }
      } catch (const Error& e) {
        // A later failure does not discard an earlier result.
        if (best.models.empty() || e.code() != ExitCode::kExternalProgram) throw;
        report_.notes.push_back("the strategy \"" + strategy.name +
                                "\" failed: " + e.what_failed());
        break;
      }
      const size_t before = Registered(best);
      const bool better =
          best.models.empty() || (!attempt->models.empty() &&
                                  attempt->models.front().Rank() > best.models.front().Rank());
      if (better) best = std::move(*attempt);
      const bool usable = !best.models.empty() && best.models.front().refusal.empty();
      const double fraction = Registered(best) / static_cast<double>(photos_.size());
      if (usable && fraction >= kGoodFraction) break;
      // More features and more pairs registered no further photo, so later strategies will not.
      if (usable && fraction >= options_.min_registered && Registered(best) <= before) break;
      last = FoundAllFeatures(strategy, runner_->evidence()) ? &strategy : nullptr;
      // Too few pairs connect the photos, and there are no more features.
      const int pairs = runner_->evidence().matched_pairs;
      if (best.models.empty() && last != nullptr && strategy.pairing == Pairing::kAll &&
          pairs >= 0 && pairs < static_cast<int>(photos_.size()) - 1)
        break;
      if (runner_->TimeIsOver()) break;
    }
    return best;
  }

  static bool FoundAllFeatures(const PoseStrategy& strategy, const ColmapEvidence& evidence) {
    return strategy.first_octave < 0 && evidence.MedianFeatures() < 0.9 * strategy.max_features;
  }

  // True if `next` would repeat the search of `last`, which found all features.
  static bool IsSameSearch(const PoseStrategy& last, const PoseStrategy& next) {
    return !next.keep_matches && next.pairing == last.pairing && next.lens == last.lens &&
           next.focal_factor == last.focal_factor && next.init_angle_deg == last.init_angle_deg;
  }

  static size_t Registered(const AttemptResult& attempt) {
    return attempt.models.empty() ? 0 : attempt.models.front().model.images.size();
  }

  // Tries again with the next simpler lens that gives a model, if `why` says that the attempt's
  // lens is implausible. False if the attempt remains as it is.
  bool Simplify(const std::string& why, AttemptResult* attempt) {
    if (why.empty() || Registered(*attempt) < kFewestForASimplerLens) return false;
    lens_failures_.push_back(attempt->Name() + ": " + why);
    for (int next = static_cast<int>(attempt->freedom) + 1;
         next <= static_cast<int>(LensFreedom::kHeldFocal) && !runner_->TimeIsOver(); ++next) {
      AttemptResult simpler = {
          attempt->strategy, static_cast<LensFreedom>(next), attempt->folder, {}, {}};
      const bool mapped_so = simpler.freedom == LensFreedom::kSquarePixels &&
                             InfoOf(attempt->strategy.lens).focals == 1;
      if (mapped_so && !attempt->models.front().lens.empty()) continue;  // the same again
      report_.notes.push_back(
          "the lens is implausible (" + lens_failures_.back() + "); trying again with " +
          (simpler.freedom == LensFreedom::kHeldFocal
               ? "the focal length held at " + HeldFocalText(runner_->groups())
               : "one focal length for both directions"));
      if (mapped_so) {
        simpler.models = attempt->models;
        simpler.evidence = attempt->evidence;
      } else {
        simpler = runner_->MapAgain(simpler);
      }
      Record(simpler);
      if (!simpler.models.empty()) {
        *attempt = std::move(simpler);
        return true;
      }
      lens_failures_.push_back(simpler.Name() + ": no model");
    }
    return false;
  }

  void Record(const AttemptResult& attempt) {
    std::string outcome = "no model";
    if (!attempt.models.empty()) {
      const FoundModel& found = attempt.models.front();
      outcome = std::to_string(found.model.images.size()) + " of " +
                std::to_string(photos_.size()) + " photos" +
                (found.refusal.empty() ? "" : "; " + found.refusal);
    }
    report_.attempts.push_back(attempt.Name() + ": " + outcome);
  }

  bool TooFewGiven() const { return static_cast<int>(photos_.size()) < options_.min_photos; }

  // Throws if the capture is refused.
  void Check(const Capture& capture) {
    SceneLimits limits = limits_;
    if (TooFewGiven()) limits.min_views = 0;  // RefuseTooFew has a better message
    const SceneAssessment assessment = AssessScene(capture, limits);
    std::string tried;
    if (!assessment.lens.empty())
      for (const std::string& failure : lens_failures_) tried += "\n  " + failure;
    if (!tried.empty()) tried = ". Simpler lenses were tried, too:" + tried;
    if (!assessment.refusal.empty())
      Refuse({assessment.refusal + tried, assessment.remedy}, photos_.size(),
             options_.min_photos);
    if (TooFewGiven()) RefuseTooFew(photos_.size(), options_.min_photos);
    if (capture.views.size() < options_.min_registered * static_cast<double>(photos_.size()))
      RefuseUnregistered(capture);
    report_.notes.insert(report_.notes.end(), assessment.notes.begin(), assessment.notes.end());
  }

  void Describe(const AttemptResult& best, const RefinedModel& refined) const {
    report_.strategy = best.Name();
    if (best.freedom == LensFreedom::kHeldFocal)
      report_.notes.push_back(
          "the photos do not determine the lens: its focal length is held at " +
          HeldFocalText(runner_->groups()) + ", and the scene's depth is as wrong as that is");
    report_.lens = refined.lens;
    if (best.models.size() > 1) report_.notes.push_back(NoteOnOtherModels(best));
  }

  static void CopyModel(const std::string& from, const std::string& to) {
    fs::create_directories(to);
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"})
      fs::copy_file(fs::path(from) / name, fs::path(to) / name,
                    fs::copy_options::overwrite_existing);
  }

  const std::vector<StagedPhoto>& photos_;
  const PoseOptions& options_;
  const std::string work_folder_;
  const ProgressFunction& progress_;
  PoseReport& report_;
  std::optional<AttemptRunner> runner_;
  std::vector<std::string> lens_failures_;  // "quick, one focal length: no model"
  SceneLimits limits_;
};

}  // namespace

Capture PosesFromPhotos(const std::vector<StagedPhoto>& photos,
                        const std::vector<PhotoStatus>& ingest_statuses,
                        const PoseOptions& options, const std::string& work_folder,
                        const std::string& sparse_output_folder,
                        const ProgressFunction& progress, PoseReport* report) {
  PoseReport ignored;
  PoseFinder finder(photos, options, work_folder, progress, report ? report : &ignored);
  try {
    Capture capture = finder.Find(sparse_output_folder);
    capture.statuses = MergeStatuses(ingest_statuses, capture.statuses);
    return capture;
  } catch (const fs::filesystem_error& e) {
    throw Error(ExitCode::kResources, e.what(), e.path1().string(),
                "is the disk full, or the folder not writable?");
  }
}

}  // namespace regrade
