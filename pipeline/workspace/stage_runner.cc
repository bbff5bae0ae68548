#include "pipeline/workspace/stage_runner.h"

#include <algorithm>
#include <iterator>
#include <new>
#include <string>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
#include "pipeline/program/cpu_time.h"

namespace regrade {
namespace {

// What a person reads.
constexpr const char* kTitles[] = {"finding where each photo was taken",
                                   "fitting the scene to the photos",
                                   "recolouring each view",
                                   "applying the style to the scene",
                                   "rendering frames and films",
                                   "measuring",
                                   "writing the report"};

size_t PlaceOf(const std::string& stage) {
  const auto* found = std::find(std::begin(kStageNames), std::end(kStageNames), stage);
  REGRADE_CHECK(found != std::end(kStageNames));
  return static_cast<size_t>(found - std::begin(kStageNames));
}

// "stage 2 of 7: fitting the scene to the photos".
std::string TitleOf(const Stage& stage) {
  const size_t place = PlaceOf(stage.name);
  return Concat("stage ", place + 1, " of ", std::size(kStageNames), ": ",
                stage.title.empty() ? kTitles[place] : stage.title);
}

}  // namespace

std::string StageRunner::About(const std::string& stage) const {
  const auto own = expected_.find(stage);
  return own == expected_.end() ? "" : ", about " + DurationText(own->second);
}

void StageRunner::RestartFrom(const std::string& stage) {
  if (stage.empty()) return;
  if (dry_run_) {
    planned_restart_ = stage;
    return;
  }
  FolderOf(stage)->Forget(stage);
  ForgetAfter(stage);
}

std::string StageRunner::Finished() const {
  std::string finished = Join(scene_->FinishedStages(), ", ");
  if (style_ == nullptr || style_ == scene_) return finished;
  const std::string of_style = Join(style_->FinishedStages(), ", ");
  return finished + (finished.empty() || of_style.empty() ? "" : ", ") + of_style;
}

namespace {

// Of many reasons a few: all files of a folder may be gone.
std::vector<std::string> FirstOf(std::vector<std::string> reasons) {
  constexpr size_t kSaid = 8;
  if (reasons.size() <= kSaid) return reasons;
  const size_t more = reasons.size() - kSaid;
  reasons.resize(kSaid);
  reasons.push_back(Concat("and ", more, " more"));
  return reasons;
}

}  // namespace

void StageRunner::ForgetAfter(const std::string& stage) {
  for (size_t i = PlaceOf(stage) + 1; i < std::size(kStageNames); ++i)
    if (Workspace* folder = FolderOf(kStageNames[i])) folder->Forget(kStageNames[i]);
}

bool StageRunner::Run(const Stage& stage) {
  if (stage.name == planned_restart_) {
    console_->Info(stage.name + ": would be done again" + About(stage.name));
    return false;
  }
  Workspace* const folder = FolderOf(stage.name);
  const StageStatus status = folder->Status(stage.name, stage.inputs);
  if (status.state == StageState::kDone) {
    console_->Info(stage.name + ": done before");
    return true;
  }
  if (status.state == StageState::kInputsDiffer && stage.refuse_changes)
    throw InputError(
        "stage " + stage.name + " was done from other inputs (" + Join(status.why, "; ") + ")",
        folder->folder(),
        "use the old ones, another --out, or --restart-from " + stage.name +
            " to replace what is there");
  const std::string why =
      status.why.empty() ? "" : " (" + Join(FirstOf(status.why), "; ") + ")";
  if (dry_run_) {
    console_->Info(stage.name + ": would be done" + why +
                   (stage.plan.empty() ? "" : ": " + stage.plan) + About(stage.name));
    for (const std::string& warning : stage.plan_warnings) console_->Warn(warning);
    return false;
  }
  if (!why.empty()) console_->Info(stage.name + ": is done again" + why);

  // The later stages are out of date now; the inputs of their checkpoints differ.
  if (status.state != StageState::kNeverDone) folder->Forget(stage.name);
  ForgetAfter(stage.name);
  console_->SetKept(Finished());
  double later = later_;
  for (size_t i = PlaceOf(stage.name) + 1; i < std::size(kStageNames); ++i)
    if (const auto next = expected_.find(kStageNames[i]); next != expected_.end())
      later += next->second;
  const auto own = expected_.find(stage.name);
  console_->Info(TitleOf(stage));
  console_->BeginStage(stage.name, TitleOf(stage), own != expected_.end() ? own->second : 0,
                       later);
  const double cpu_before = CpuSeconds();
  StageOutcome outcome;
  try {
    outcome = stage.work(console_->StageProgress());
  } catch (const std::bad_alloc&) {
    throw ResourceError("out of memory in stage " + stage.name, folder->folder(),
                        "close other programs, use --preset draft, or set --max-memory");
  }
  const double seconds = console_->StageSeconds();
  folder->Record(stage.name, stage.inputs, outcome.outputs, seconds, outcome.metrics,
                 CpuSeconds() - cpu_before);
  console_->EndStage();
  console_->SetKept(Finished());
  console_->Info(stage.name + ": done in " + DurationText(seconds));
  return true;
}

StageRecord StageRunner::Require(const std::string& stage, const std::string& how) const {
  const Workspace* const folder = FolderOf(stage);
  const std::optional<StageRecord> record = folder->Find(stage);
  if (!record)
    throw InputError("stage " + stage + " has not been done here", folder->folder(),
                     "run `" + how + "` first");
  const std::vector<std::string> changed = ChangedOutputs(folder->folder(), *record);
  if (!changed.empty())
    throw InputError(Join(changed, "; "), folder->folder(),
                     "run `" + how + "` again: it will redo that stage");
  return *record;
}

}  // namespace regrade
