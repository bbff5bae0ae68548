// For each strategy: extracts, matches and maps with COLMAP and reads the models, until enough
// photos are registered. Then refines and checks the best model, or refuses with a reason.
#include "reconstruct/colmap/poses_from_photos.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_output.h"
#include "reconstruct/colmap/colmap_program.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/photo_statuses.h"
#include "reconstruct/colmap/pose_weights.h"
#include "reconstruct/colmap/refine_intrinsics.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr double kGoodFraction = 0.95;  // of the photos: enough to stop
constexpr double kBytesPerPhoto = 3e6;  // upper bound of database and logs

class PoseFinder {
 public:
  PoseFinder(const std::vector<StagedPhoto>& photos, const PoseOptions& options,
             const std::string& work_folder, const ProgressFunction& progress,
             PoseReport* report)
      : photos_(photos),
        options_(options),
        work_folder_(fs::absolute(work_folder).string()),
        progress_(progress),
        report_(*report),
        output_(static_cast<int>(photos.size())),
        threads_(options.threads) {
    limits_.min_views = options.min_photos;
    const double n = static_cast<double>(photos.size());
    const double automatic = 600 + 60 * n + 2 * std::min(n * (n - 1) / 2, 40 * n);
    deadline_ =
        ClockSeconds() + (options.time_limit_min > 0 ? 60 * options.time_limit_min : automatic);
  }

  Capture Find(const std::string& sparse_output_folder) {
    CheckPhotos();
    PrepareFolders();
    colmap_.emplace(options_.colmap, work_folder_ + "/logs");
    report_.colmap_version = colmap_->version();
    const AttemptResult best = TryStrategies();
    if (best.models.empty())
      Refuse(WhyNoModel(best.evidence), photos_.size(), options_.min_photos);
    const RefinedModel refined = Refine(best.models.front().model);
    Capture capture = CaptureFromModel(refined.model, photos_);
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
      throw InputError("there are no photos", "", "give a folder with photos");
    if (photos_.size() == 1)
      throw SceneError("one photo shows no depth", photos_.front().file,
                       "take 20 to 60 photos, stepping sideways between them");
    const fs::path folder = fs::path(photos_.front().path).parent_path();
    for (const StagedPhoto& photo : photos_)
      REGRADE_CHECK_EQ(fs::path(photo.path), folder / photo.name);
    photo_folder_ = fs::absolute(folder).string();
  }

  void PrepareFolders() {
    fs::create_directories(work_folder_ + "/logs");
    const double needed = kBytesPerPhoto * static_cast<double>(photos_.size());
    const double available = static_cast<double>(fs::space(work_folder_).available);
    if (available < needed)
      throw ResourceError(Concat("too little free disk space: ", std::lround(available / 1e6),
                                 " MB free, about ", std::lround(needed / 1e6), " MB needed"),
                          work_folder_, "free some space, or choose another --out");
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
        attempt = RunStrategy(strategy);
      } catch (const Error& e) {
        // A later failure does not discard an earlier result.
        if (best.models.empty() || e.code() != ExitCode::kExternalProgram) throw;
        report_.notes.push_back("the strategy \"" + strategy.name +
                                "\" failed: " + e.what_failed());
        break;
      }
      ++report_.attempts_made;
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
      last = FoundAllFeatures(strategy, output_.evidence()) ? &strategy : nullptr;
      // Too few pairs connect the photos, and there are no more features.
      const int pairs = output_.evidence().matched_pairs;
      if (best.models.empty() && last != nullptr && strategy.all_pairs && pairs >= 0 &&
          pairs < std::ssize(photos_) - 1)
        break;
      if (ClockSeconds() > deadline_) break;
    }
    return best;
  }

  static bool FoundAllFeatures(const PoseStrategy& strategy, const ColmapEvidence& evidence) {
    return strategy.first_octave < 0 && evidence.MedianFeatures() < 0.9 * strategy.max_features;
  }

  // True if `next` would repeat the search of `last`, which found all features.
  static bool IsSameSearch(const PoseStrategy& last, const PoseStrategy& next) {
    return !next.keep_matches && next.all_pairs == last.all_pairs && next.lens == last.lens &&
           next.focal_factor == last.focal_factor && next.init_angle_deg == last.init_angle_deg;
  }

  static size_t Registered(const AttemptResult& attempt) {
    return attempt.models.empty() ? 0 : attempt.models.front().model.images.size();
  }

  AttemptResult RunStrategy(const PoseStrategy& strategy) {
    try {
      return TryStrategy(strategy);
    } catch (const Crash&) {
      // COLMAP's memory grows with its threads, so one thread may succeed.
      if (threads_ == 1) throw;
      threads_ = 1;
      report_.notes.push_back("COLMAP crashed and was restarted with one thread");
      PoseStrategy again = strategy;
      again.keep_matches = false;
      return TryStrategy(again);
    }
  }

  // A crash, after which a restart with less memory may succeed.
  struct Crash : Error {
    using Error::Error;
  };

  AttemptResult TryStrategy(const PoseStrategy& strategy) {
    const PoseWeights weights = EstimateWeights(strategy, photos_, options_.image_size);
    planned_ = spent_ + weights.Sum();
    const std::string attempt_folder =
        strategy.keep_matches ? attempt_folder_
                              : Concat(work_folder_, "/attempt_", report_.attempts_made + 1);
    const ColmapPaths paths = {photo_folder_, attempt_folder + "/database.db",
                               attempt_folder + "/images.txt", attempt_folder + "/sparse",
                               options_.mask_folder};
    if (!strategy.keep_matches) {
      // COLMAP keeps existing entries of a database, even if they were made with other options.
      fs::remove_all(attempt_folder);
      fs::create_directories(attempt_folder);
      attempt_folder_ = attempt_folder;
      for (const CameraGroup& group : groups_) Extract(strategy, group, paths, weights.extract);
      RunStage(MatchCommand(strategy), MatchArguments(strategy, threads_, paths), "matching",
               strategy.name, weights.match);
    }
    fs::remove_all(paths.model);
    fs::create_directories(paths.model);
    return Map(strategy, paths, weights.map);
  }

  void Extract(const PoseStrategy& strategy, const CameraGroup& group, const ColmapPaths& paths,
               double weight) {
    std::ofstream list(paths.image_list, std::ios::trunc);
    for (const std::string& name : group.names) list << name << "\n";
    list.close();
    const double fraction = static_cast<double>(group.names.size()) / photos_.size();
    RunStage("feature_extractor",
             ExtractArguments(strategy, group, options_.image_size, threads_, paths),
             "features", strategy.name, weight * fraction);
    std::error_code none;
    if (fs::file_size(paths.database, none) == 0 || none)
      throw ProgramError(
          "colmap feature_extractor ended without an error, but wrote no database",
          colmap_->log_folder(), "see its log");
  }

  AttemptResult Map(const PoseStrategy& strategy, const ColmapPaths& paths, double weight) {
    const ChildResult result = RunColmap(
        "mapper", MapArguments(strategy, static_cast<int>(photos_.size()), threads_, paths),
        "mapping", strategy.name, weight);
    AttemptResult attempt{strategy.name, {}, output_.evidence()};
    std::string damage;
    std::set<fs::path> folders;
    for (const auto& entry : fs::directory_iterator(paths.model))
      if (entry.is_directory()) folders.insert(entry.path());
    for (const fs::path& folder : folders) {
      FoundModel found;
      try {
        found.model = ReadColmapModel(folder.string());
        if (found.model.images.empty()) continue;
        found.capture = CaptureFromModel(found.model, photos_);
      } catch (const Error& e) {
        damage = e.what();
        continue;
      }
      SceneLimits lenient = limits_;
      lenient.min_views = 2;
      found.refusal = AssessScene(found.capture, lenient).refusal;
      attempt.models.push_back(std::move(found));
    }
    std::ranges::stable_sort(attempt.models,
                             [](const auto& a, const auto& b) { return a.Rank() > b.Rank(); });
    // A mapper that was stopped by its time limit may still have written complete models.
    if (!attempt.models.empty()) return attempt;
    if (!damage.empty())
      throw ProgramError(
          "colmap mapper (" + result.Describe() + ") left a damaged model: " + damage,
          colmap_->log_folder() + "/mapper.log", "is the disk full?");
    if (result.Succeeded())
      throw ProgramError("colmap mapper ended without an error, but wrote no model",
                         colmap_->log_folder() + "/mapper.log", "see its log");
    // mapper exits with 1 if it found no model.
    if (result.end != ChildEnd::kExited || result.exit_status != 1) FailStage("mapper", result);
    return attempt;
  }

  void RunStage(const std::string& command, const ColmapArguments& arguments,
                const std::string& what, const std::string& strategy, double weight) {
    const ChildResult result = RunColmap(command, arguments, what, strategy, weight);
    // The matchers abort on a database without features; mapper then reports it.
    const bool no_features = output_.evidence().MedianFeatures() == 0;
    if (!result.Succeeded() && !(command != "feature_extractor" && no_features))
      FailStage(command, result);
  }

  ChildResult RunColmap(const std::string& command, const ColmapArguments& arguments,
                        const std::string& what, const std::string& strategy, double weight) {
    output_.StartCommand();
    const auto tick = [&] {
      return ReportAt(spent_ + weight * output_.fraction(), what + " (" + strategy + ")");
    };
    const ChildResult result = colmap_->Run(
        command, arguments, command,
        {std::max(1.0, deadline_ - ClockSeconds()), 60 * options_.quiet_limit_min},
        [&](const std::string& line) { output_.Line(line); }, tick);
    spent_ += weight;
    return result;
  }

  // False if the user cancelled.
  bool ReportAt(double done, const std::string& note) {
    return Report(progress_, std::min(done, planned_), planned_, note) != LoopControl::kStop;
  }

  [[noreturn]] void FailStage(const std::string& command, const ChildResult& result) const {
    try {
      colmap_->Fail(command, result, command);
    } catch (const Error& e) {
      if (!result.TimedOut() && (result.signal != 0 || result.exit_status >= 128))
        throw Crash(e.code(), e.what_failed(), e.where(), e.hint());
      throw;
    }
  }

  RefinedModel Refine(const ColmapModel& grown) {
    const double weight = planned_ - spent_;
    double done = spent_;
    const auto on_step = [&](int step, int steps) { done = spent_ + weight * step / steps; };
    return RefineIntrinsics(
        *colmap_, grown, work_folder_,
        {std::max(60.0, deadline_ - ClockSeconds()), 60 * options_.quiet_limit_min}, on_step,
        [&] { return ReportAt(done, "adjusting"); });
  }

  bool TooFewGiven() const { return static_cast<int>(photos_.size()) < options_.min_photos; }

  // Throws if the capture is refused.
  void Check(const Capture& capture) {
    SceneLimits limits = limits_;
    if (TooFewGiven()) limits.min_views = 0;  // RefuseTooFew has a better message
    const SceneAssessment assessment = AssessScene(capture, limits);
    if (!assessment.refusal.empty())
      Refuse({assessment.refusal, assessment.remedy}, photos_.size(), options_.min_photos);
    if (TooFewGiven()) RefuseTooFew(photos_.size(), options_.min_photos);
    if (capture.views.size() < options_.min_registered * static_cast<double>(photos_.size()))
      RefuseUnregistered(capture);
    report_.notes.insert(report_.notes.end(), assessment.notes.begin(), assessment.notes.end());
  }

  void Describe(const AttemptResult& best, const RefinedModel& refined) const {
    report_.strategy = best.strategy;
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
  const std::vector<CameraGroup> groups_ = GroupByCamera(photos_);
  ColmapOutput output_;
  std::optional<ColmapProgram> colmap_;
  std::string photo_folder_, attempt_folder_;
  SceneLimits limits_;
  int threads_;
  double deadline_ = 0;             // of ClockSeconds()
  double spent_ = 0, planned_ = 0;  // estimated seconds
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
    throw ResourceError(e.what(), e.path1().string(),
                        "is the disk full, or the folder not writable?");
  }
}

}  // namespace regrade
