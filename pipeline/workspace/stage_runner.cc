#include "pipeline/workspace/stage_runner.h"

#include <algorithm>
#include <iterator>
#include <new>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
#include "pipeline/program/cpu_time.h"

namespace regrade {
namespace {

size_t PlaceOf(const std::string& stage) {
  const auto* found = std::find(std::begin(kStageNames), std::end(kStageNames), stage);
  REGRADE_CHECK(found != std::end(kStageNames));
  return static_cast<size_t>(found - std::begin(kStageNames));
}

}  // namespace

void StageRunner::RestartFrom(const std::string& stage) {
  if (stage.empty()) return;
  if (dry_run_) {
    planned_restart_ = stage;
    return;
  }
  workspace_->Forget(stage);
  ForgetAfter(stage);
}

void StageRunner::ForgetAfter(const std::string& stage) {
  for (size_t i = PlaceOf(stage) + 1; i < std::size(kStageNames); ++i)
    workspace_->Forget(kStageNames[i]);
}

bool StageRunner::Run(const Stage& stage) {
  if (stage.name == planned_restart_) {
    console_->Info(stage.name + ": would be done again");
    return false;
  }
  const StageStatus status = workspace_->Status(stage.name, stage.inputs);
  if (status.state == StageState::kDone) {
    console_->Info(stage.name + ": done before");
    return true;
  }
  if (status.state == StageState::kInputsDiffer && stage.refuse_changes)
    throw InputError(
        "stage " + stage.name + " was done from other inputs (" + Join(status.why, "; ") + ")",
        workspace_->folder(),
        "use the old ones, another --out, or --restart-from " + stage.name +
            " to replace what is there");
  const std::string why = status.why.empty() ? "" : " (" + Join(status.why, "; ") + ")";
  if (dry_run_) {
    console_->Info(stage.name + ": would be done" + why +
                   (stage.plan.empty() ? "" : ": " + stage.plan));
    return false;
  }
  if (!why.empty()) console_->Info(stage.name + ": is done again" + why);

  // The later stages are out of date now; the inputs of their checkpoints differ.
  if (status.state != StageState::kNeverDone) workspace_->Forget(stage.name);
  ForgetAfter(stage.name);
  console_->SetKept(Join(workspace_->FinishedStages(), ", "));
  console_->BeginStage(stage.name);
  const double cpu_before = CpuSeconds();
  StageOutcome outcome;
  try {
    outcome = stage.work(console_->StageProgress());
  } catch (const std::bad_alloc&) {
    throw ResourceError("out of memory in stage " + stage.name, workspace_->folder(),
                        "close other programs, use --preset draft, or set --max-memory");
  }
  const double seconds = console_->StageSeconds();
  workspace_->Record(stage.name, stage.inputs, outcome.outputs, seconds, outcome.metrics,
                     CpuSeconds() - cpu_before);
  console_->EndStage();
  console_->SetKept(Join(workspace_->FinishedStages(), ", "));
  console_->Info(stage.name + ": done in " + DurationText(seconds));
  return true;
}

StageRecord StageRunner::Require(const std::string& stage, const std::string& how) const {
  const std::optional<StageRecord> record = workspace_->Find(stage);
  if (!record)
    throw InputError("stage " + stage + " has not been done here", workspace_->folder(),
                     "run `" + how + "` first");
  const std::vector<std::string> changed = ChangedOutputs(workspace_->folder(), *record);
  if (!changed.empty())
    throw InputError(Join(changed, "; "), workspace_->folder(),
                     "run `" + how + "` again: it will redo that stage");
  return *record;
}

}  // namespace regrade
