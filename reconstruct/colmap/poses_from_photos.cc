// The climb: for each recipe extract, match, map; read what came out with our own reader; stop
// when enough photos are placed; then adjust, judge and hand over, or refuse with a reason.
#include "reconstruct/colmap/poses_from_photos.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <set>

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

constexpr double kGoodShare = 0.95;     // of the photos: no need to climb further
constexpr double kBytesPerPhoto = 3e6;  // database and logs, generously

double Now() {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

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
    deadline_ = Now() + (options.time_limit_min > 0 ? 60 * options.time_limit_min : automatic);
  }

  Capture Find(const std::string& sparse_output_folder) {
    CheckPhotos();
    PrepareFolders();
    colmap_.emplace(options_.colmap, work_folder_ + "/logs");
    report_.colmap_version = colmap_->version();
    const AttemptResult best = Climb();
    if (best.models.empty())
      Refuse(WhyNoModel(best.evidence), photos_.size(), options_.min_photos);
    const RefinedModel refined = Refine(best.models.front().model);
    Capture capture = CaptureFromModel(refined.model, photos_);
    capture.models_found = static_cast<int>(best.models.size());
    ExplainUnregistered(best, photos_, &capture);
    Judge(capture);
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
    photo_folder_ = fs::absolute(folder).string();
  }

  void PrepareFolders() {
    fs::create_directories(work_folder_ + "/logs");
    const double needed = kBytesPerPhoto * static_cast<double>(photos_.size());
    const double available = static_cast<double>(fs::space(work_folder_).available);
    if (available < needed)
      throw Error(
          ExitCode::kResources,
          "too little space on the disk: " + std::to_string(std::lround(available / 1e6)) +
              " MB free, about " + std::to_string(std::lround(needed / 1e6)) + " MB needed",
          work_folder_, "free some space, or choose another --out");
  }

  // The best attempt, or the last one's evidence without models.
  AttemptResult Climb() {
    std::vector<PoseRecipe> strategies = PoseStrategies(photos_, options_.all_pairs_up_to);
    // So few photos are refused whatever comes; one attempt says whether more is wrong with
    // them.
    if (TooFewGiven()) strategies.resize(1);
    AttemptResult best;
    const PoseRecipe* last = nullptr;  // the recipe before, if it found all features there are
    for (const PoseRecipe& recipe : strategies) {
      if (last != nullptr && IsSameSearch(*last, recipe)) continue;
      std::optional<AttemptResult> attempt;
      try {
        attempt = RunRecipe(recipe);
      } catch (const Error& e) {
        // What an earlier attempt found is not lost with a later one.
        if (best.models.empty() || e.code() != ExitCode::kExternalProgram) throw;
        report_.notes.push_back("the recipe \"" + recipe.name +
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
      const double share = Registered(best) / static_cast<double>(photos_.size());
      if (usable && share >= kGoodShare) break;
      // More features and more pairs placed no further photo: neither will what follows.
      if (usable && share >= options_.min_registered && Registered(best) <= before) break;
      last = FoundAllFeatures(recipe, output_.evidence()) ? &recipe : nullptr;
      // Too few pairs to connect the photos, and no more features to find pairs with.
      const int pairs = output_.evidence().matched_pairs;
      if (best.models.empty() && last != nullptr && recipe.all_pairs && pairs >= 0 &&
          pairs < static_cast<int>(photos_.size()) - 1)
        break;
      if (Now() > deadline_) break;
    }
    return best;
  }

  static bool FoundAllFeatures(const PoseRecipe& recipe, const ColmapEvidence& evidence) {
    return recipe.first_octave < 0 && evidence.MedianFeatures() < 0.9 * recipe.max_features;
  }

  // Would `next` find again what `last` found, which had all the features that there are?
  static bool IsSameSearch(const PoseRecipe& last, const PoseRecipe& next) {
    return !next.keep_matches && next.all_pairs == last.all_pairs && next.lens == last.lens &&
           next.focal_factor == last.focal_factor && next.init_angle_deg == last.init_angle_deg;
  }

  static size_t Registered(const AttemptResult& attempt) {
    return attempt.models.empty() ? 0 : attempt.models.front().model.images.size();
  }

  AttemptResult RunRecipe(const PoseRecipe& recipe) {
    try {
      return TryRecipe(recipe);
    } catch (const Crash&) {
      // Threads multiply COLMAP's memory; one is the safest way to run it.
      if (threads_ == 1) throw;
      threads_ = 1;
      report_.notes.push_back("COLMAP crashed and was started again with one thread");
      PoseRecipe again = recipe;
      again.keep_matches = false;
      return TryRecipe(again);
    }
  }

  // A failure that a second start with less memory may get past.
  struct Crash : Error {
    using Error::Error;
  };

  AttemptResult TryRecipe(const PoseRecipe& recipe) {
    const PoseWeights weights = EstimateWeights(recipe, photos_, options_.image_size);
    planned_ = spent_ + weights.Sum();
    const std::string attempt_folder =
        recipe.keep_matches
            ? attempt_folder_
            : work_folder_ + "/attempt_" + std::to_string(report_.attempts_made + 1);
    const ColmapPaths paths = {photo_folder_, attempt_folder + "/database.db",
                               attempt_folder + "/images.txt", attempt_folder + "/sparse",
                               options_.mask_folder};
    if (!recipe.keep_matches) {
      // COLMAP skips what a database holds already, also when it was made with other options.
      fs::remove_all(attempt_folder);
      fs::create_directories(attempt_folder);
      attempt_folder_ = attempt_folder;
      for (const CameraGroup& group : groups_) Extract(recipe, group, paths, weights.extract);
      RunStage(MatchCommand(recipe), MatchArguments(recipe, threads_, paths), "matching",
               recipe.name, weights.match);
    }
    fs::remove_all(paths.model);
    fs::create_directories(paths.model);
    return Map(recipe, paths, weights.map);
  }

  void Extract(const PoseRecipe& recipe, const CameraGroup& group, const ColmapPaths& paths,
               double weight) {
    std::ofstream list(paths.image_list, std::ios::trunc);
    for (const std::string& name : group.names) list << name << "\n";
    list.close();
    const double share = static_cast<double>(group.names.size()) / photos_.size();
    RunStage("feature_extractor",
             ExtractArguments(recipe, group, options_.image_size, threads_, paths), "features",
             recipe.name, weight * share);
    std::error_code none;
    if (fs::file_size(paths.database, none) == 0 || none)
      throw Error(ExitCode::kExternalProgram,
                  "colmap feature_extractor ended without an error, but wrote no database",
                  colmap_->log_folder(), "its log may say why");
  }

  AttemptResult Map(const PoseRecipe& recipe, const ColmapPaths& paths, double weight) {
    const ChildResult result = RunColmap(
        "mapper", MapArguments(recipe, static_cast<int>(photos_.size()), threads_, paths),
        "mapping", recipe.name, weight);
    AttemptResult attempt{recipe.name, {}, output_.evidence()};
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
    std::stable_sort(attempt.models.begin(), attempt.models.end(),
                     [](const auto& a, const auto& b) { return a.Rank() > b.Rank(); });
    // A mapper that was ended by its time limit leaves models that are complete all the same.
    if (!attempt.models.empty()) return attempt;
    if (!damage.empty())
      throw Error(ExitCode::kExternalProgram,
                  "colmap mapper (" + result.Describe() + ") left a damaged model: " + damage,
                  colmap_->log_folder() + "/mapper.log", "is the disk full?");
    if (result.Succeeded())
      throw Error(ExitCode::kExternalProgram,
                  "colmap mapper ended without an error, but wrote no model",
                  colmap_->log_folder() + "/mapper.log", "its log may say why");
    // Exit status 1 is how it says that it found no model.
    if (result.end != ChildEnd::kExited || result.exit_status != 1) FailStage("mapper", result);
    return attempt;
  }

  void RunStage(const std::string& command, const ColmapArguments& arguments,
                const std::string& what, const std::string& recipe, double weight) {
    const ChildResult result = RunColmap(command, arguments, what, recipe, weight);
    // The matchers abort on a database without a single feature; mapper then says the rest.
    const bool no_features = output_.evidence().MedianFeatures() == 0;
    if (!result.Succeeded() && !(command != "feature_extractor" && no_features))
      FailStage(command, result);
  }

  ChildResult RunColmap(const std::string& command, const ColmapArguments& arguments,
                        const std::string& what, const std::string& recipe, double weight) {
    output_.StartCommand();
    const auto tick = [&] {
      return ReportAt(spent_ + weight * output_.fraction(), what + " (" + recipe + ")");
    };
    const ChildResult result = colmap_->Run(
        command, arguments, command,
        {std::max(1.0, deadline_ - Now()), 60 * options_.quiet_limit_min},
        [&](const std::string& line) { output_.Line(line); }, tick);
    spent_ += weight;
    return result;
  }

  // False when the user wants out.
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
    return RefineIntrinsics(*colmap_, grown, work_folder_,
                            {std::max(60.0, deadline_ - Now()), 60 * options_.quiet_limit_min},
                            on_step, [&] { return ReportAt(done, "adjusting"); });
  }

  bool TooFewGiven() const { return static_cast<int>(photos_.size()) < options_.min_photos; }

  // Throws the refusal, if there is one.
  void Judge(const Capture& capture) {
    SceneLimits limits = limits_;
    if (TooFewGiven()) limits.min_views = 0;  // said already, and better
    const SceneAssessment assessment = AssessScene(capture, limits);
    if (!assessment.refusal.empty())
      Refuse({assessment.refusal, assessment.remedy}, photos_.size(), options_.min_photos);
    if (TooFewGiven()) RefuseTooFew(photos_.size(), options_.min_photos);
    if (capture.views.size() < options_.min_registered * static_cast<double>(photos_.size()))
      RefuseUnregistered(capture);
    report_.notes.insert(report_.notes.end(), assessment.notes.begin(), assessment.notes.end());
  }

  void Describe(const AttemptResult& best, const RefinedModel& refined) const {
    report_.recipe = best.recipe;
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
  double deadline_ = 0;             // on Now()'s clock
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
    throw Error(ExitCode::kResources, e.what(), e.path1().string(),
                "is the disk full, or the folder not writable?");
  }
}

}  // namespace regrade
