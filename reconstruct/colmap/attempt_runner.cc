// The commands of COLMAP in their order, with restarts, and checks of what they leave.
#include "reconstruct/colmap/attempt_runner.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>
#include <utility>

#include "kernels/base/error.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/colmap/colmap_program.h"
#include "reconstruct/colmap/listed_pairs.h"
#include "reconstruct/colmap/place_pairs.h"
#include "reconstruct/colmap/pose_weights.h"
#include "reconstruct/scene/scene_checks.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr double kBytesPerPhoto = 3e6;  // upper bound of database and logs

double Now() {
  using Clock = std::chrono::steady_clock;
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

}  // namespace

class AttemptRunner::Impl {
 public:
  Impl(const std::vector<StagedPhoto>& photos, const PoseOptions& options,
       const std::string& work_folder, const ProgressFunction& progress, PoseReport* report)
      : photos_(photos),
        options_(options),
        work_folder_(fs::absolute(work_folder).string()),
        photo_folder_(fs::absolute(fs::path(photos.front().path).parent_path()).string()),
        progress_(progress),
        report_(*report),
        output_(static_cast<int>(photos.size())),
        log_folder_(MakeLogFolder()),
        colmap_(options.colmap, log_folder_, options.colmap_gpu),
        threads_(options.threads) {
    const double n = static_cast<double>(photos.size());
    const double automatic = 600 + 60 * n + 2 * std::min(n * (n - 1) / 2, 40 * n);
    deadline_ = Now() + (options.time_limit_min > 0 ? 60 * options.time_limit_min : automatic);
    report_.colmap_version = colmap_.version();
  }

  AttemptResult Run(const PoseStrategy& strategy, size_t number) {
    try {
      return TryStrategy(strategy, number);
    } catch (const Crash&) {
      // COLMAP's memory grows with its threads, so one thread may succeed.
      if (threads_ == 1) throw;
      threads_ = 1;
      report_.notes.push_back("COLMAP crashed and was restarted with one thread");
      PoseStrategy again = strategy;
      again.keep_matches = false;
      return TryStrategy(again, number);
    }
  }

  AttemptResult MapAgain(const AttemptResult& attempt) {
    const PoseWeights weights = EstimateWeights(attempt.strategy, photos_, options_.image_size);
    planned_ = spent_ + weights.map + weights.refine;
    try {
      return Map(attempt, weights.map);
    } catch (const Error& e) {
      if (e.code() != ExitCode::kExternalProgram) throw;
      report_.notes.push_back("that failed: " + e.what_failed());
      return attempt;
    }
  }

  RefinedModel Refine(const AttemptResult& attempt) {
    const double weight = planned_ - spent_;
    double done = spent_;
    const auto on_step = [&](int step, int steps) { done = spent_ + weight * step / steps; };
    RefinedModel refined =
        RefineIntrinsics(colmap_, attempt.models.front().model, attempt.freedom, work_folder_,
                         {std::max(60.0, deadline_ - Now()), 60 * options_.quiet_limit_min},
                         on_step, [&] { return ReportAt(done, "adjusting"); });
    spent_ = planned_;
    return refined;
  }

  bool TimeIsOver() const { return Now() > deadline_; }
  const std::vector<CameraGroup>& groups() const { return groups_; }
  const ColmapEvidence& evidence() const { return output_.evidence(); }

 private:
  // Its path, where there is space for what the attempts write.
  std::string MakeLogFolder() const {
    const std::string folder = work_folder_ + "/logs";
    fs::create_directories(folder);
    const double needed = kBytesPerPhoto * static_cast<double>(photos_.size());
    const double available = static_cast<double>(fs::space(work_folder_).available);
    if (available < needed)
      throw Error(
          ExitCode::kResources,
          "too little free disk space: " + std::to_string(std::lround(available / 1e6)) +
              " MB free, about " + std::to_string(std::lround(needed / 1e6)) + " MB needed",
          work_folder_, "free some space, or choose another --out");
    return folder;
  }

  // A crash, after which a restart with less memory may succeed.
  struct Crash : Error {
    using Error::Error;
  };

  AttemptResult TryStrategy(const PoseStrategy& strategy, size_t number) {
    const PoseWeights weights = EstimateWeights(strategy, photos_, options_.image_size);
    planned_ = spent_ + weights.Sum();
    const std::string attempt_folder =
        strategy.keep_matches ? attempt_folder_
                              : work_folder_ + "/attempt_" + std::to_string(number);
    const ColmapPaths paths = PathsOf(attempt_folder);
    if (!strategy.keep_matches) {
      // COLMAP keeps existing entries of a database, even if they were made with other options.
      fs::remove_all(attempt_folder);
      fs::create_directories(attempt_folder);
      attempt_folder_ = attempt_folder;
      for (const CameraGroup& group : groups_) Extract(strategy, group, paths, weights.extract);
      Match(strategy, paths, weights.match);
    }
    return Map(AttemptResult{strategy, LensFreedom::kFull, attempt_folder, {}, {}},
               weights.map);
  }

  ColmapPaths PathsOf(const std::string& attempt_folder) const {
    return {photo_folder_,
            attempt_folder + "/database.db",
            attempt_folder + "/images.txt",
            attempt_folder + "/sparse",
            attempt_folder + "/vocabulary.bin",
            options_.mask_folder};
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
      throw Error(ExitCode::kExternalProgram,
                  "colmap feature_extractor ended without an error, but wrote no database",
                  colmap_.log_folder(), "see its log");
  }

  void Match(const PoseStrategy& strategy, const ColmapPaths& paths, double weight) {
    if (strategy.pairing != Pairing::kListed) {
      const std::vector<MatchStep> steps = MatchSteps(strategy, threads_, paths);
      for (const MatchStep& step : steps) {
        try {
          RunStage(step.command, step.arguments, "matching", strategy.name,
                   weight * step.weight);
        } catch (const Error& e) {
          const bool again = threads_ != 1 && dynamic_cast<const Crash*>(&e) != nullptr;
          if (e.code() != ExitCode::kExternalProgram || &step == &steps.front() || again ||
              TimeIsOver())
            throw;
          report_.notes.push_back("photos are matched mainly in the order of their names: " +
                                  e.what_failed());
          return;
        }
      }
      return;
    }
    MatchListed(HasClips(photos_) ? PairsOfClips(photos_) : PairsOfPlaces(photos_), photos_,
                paths.database, attempt_folder_ + "/pairs.txt", threads_,
                [&](const ColmapArguments& arguments, double fraction) {
                  RunStage(kListMatcher, arguments, "matching", strategy.name,
                           weight * fraction);
                });
  }

  // The attempt with the models that are found with its lens.
  AttemptResult Map(AttemptResult attempt, double weight) {
    const ColmapPaths paths = PathsOf(attempt.folder);
    ColmapArguments arguments =
        MapArguments(attempt.strategy, static_cast<int>(photos_.size()), threads_, paths);
    fs::remove_all(paths.model);
    fs::create_directories(paths.model);
    if (attempt.freedom != LensFreedom::kFull) {
      const std::string start = attempt.folder + "/start", output = paths.model + "/0";
      fs::create_directories(start);
      fs::create_directories(output);
      WriteColmapModel(StartOf(groups_, attempt.strategy, attempt.freedom), start);
      MapFrom(start, output, attempt.freedom, &arguments);
    }
    const ChildResult result =
        RunColmap("mapper", arguments, "mapping", attempt.Name(), weight);
    attempt.evidence = output_.evidence();
    std::string damage;
    std::set<fs::path> folders;
    for (const auto& entry : fs::directory_iterator(paths.model))
      if (entry.is_directory() && !fs::is_empty(entry.path())) folders.insert(entry.path());
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
      SceneLimits lenient;
      lenient.min_views = 2;
      const SceneAssessment assessment = AssessScene(found.capture, lenient);
      found.refusal = assessment.refusal;
      found.lens = assessment.lens;
      attempt.models.push_back(std::move(found));
    }
    std::stable_sort(attempt.models.begin(), attempt.models.end(),
                     [](const auto& a, const auto& b) { return a.Rank() > b.Rank(); });
    // A mapper that was stopped by its time limit may still have written complete models.
    if (!attempt.models.empty()) return attempt;
    if (!damage.empty())
      throw Error(ExitCode::kExternalProgram,
                  "colmap mapper (" + result.Describe() + ") left a damaged model: " + damage,
                  colmap_.log_folder() + "/mapper.log", "is the disk full?");
    if (result.Succeeded())
      throw Error(ExitCode::kExternalProgram,
                  "colmap mapper ended without an error, but wrote no model",
                  colmap_.log_folder() + "/mapper.log", "see its log");
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
    const ChildResult result = colmap_.Run(
        command, arguments, command,
        {std::max(1.0, deadline_ - Now()), 60 * options_.quiet_limit_min},
        [&](const std::string& line) { output_.Line(line); }, tick);
    for (std::string& note : colmap_.TakeNotes()) report_.notes.push_back(std::move(note));
    spent_ += weight;
    return result;
  }

  // False if the user cancelled.
  bool ReportAt(double done, const std::string& note) {
    return Report(progress_, std::min(done, planned_), planned_, note) != LoopControl::kStop;
  }

  [[noreturn]] void FailStage(const std::string& command, const ChildResult& result) const {
    try {
      colmap_.Fail(command, result, command);
    } catch (const Error& e) {
      if (!result.TimedOut() && (result.signal != 0 || result.exit_status >= 128))
        throw Crash(e.code(), e.what_failed(), e.where(), e.hint());
      throw;
    }
  }
  const std::vector<StagedPhoto>& photos_;
  const PoseOptions& options_;
  const std::string work_folder_, photo_folder_;
  const ProgressFunction& progress_;
  PoseReport& report_;
  const std::vector<CameraGroup> groups_ = GroupByCamera(photos_);
  ColmapOutput output_;
  const std::string log_folder_;
  ColmapProgram colmap_;
  std::string attempt_folder_;
  int threads_;
  double deadline_ = 0;             // on Now()'s clock
  double spent_ = 0, planned_ = 0;  // estimated seconds
};

AttemptRunner::AttemptRunner(const std::vector<StagedPhoto>& photos, const PoseOptions& options,
                             const std::string& work_folder, const ProgressFunction& progress,
                             PoseReport* report)
    : impl_(std::make_unique<Impl>(photos, options, work_folder, progress, report)) {}
AttemptRunner::~AttemptRunner() = default;

AttemptResult AttemptRunner::Run(const PoseStrategy& strategy, size_t number) {
  return impl_->Run(strategy, number);
}
AttemptResult AttemptRunner::MapAgain(const AttemptResult& attempt) {
  return impl_->MapAgain(attempt);
}
RefinedModel AttemptRunner::Refine(const AttemptResult& attempt) {
  return impl_->Refine(attempt);
}
bool AttemptRunner::TimeIsOver() const { return impl_->TimeIsOver(); }
const std::vector<CameraGroup>& AttemptRunner::groups() const { return impl_->groups(); }
const ColmapEvidence& AttemptRunner::evidence() const { return impl_->evidence(); }

}  // namespace regrade
