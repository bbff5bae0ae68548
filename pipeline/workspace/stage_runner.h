// Runs the stages in order: finished ones are skipped, changed ones redone or refused, and each
// finished stage is recorded.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "kernels/base/progress.h"
#include "pipeline/program/console.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

// All stages, in order. A stage that runs again causes all later ones to run again.
inline constexpr const char* kStageNames[] = {"pose",   "reconstruct", "style_2d", "stylize",
                                              "render", "evaluate",    "report"};

// Stages of the scene work in the output folder; those of a style in its folder styles/NAME.
inline bool IsOfScene(const std::string& stage) {
  return stage == "pose" || stage == "reconstruct";
}

struct StageOutcome {
  std::vector<std::string> outputs;  // files and folders, relative to the output folder
  JsonValue metrics = JsonValue::Object();
};

struct Stage {
  std::string name;
  std::string title =
      {};            // what it does, where that is not what stages of its name do otherwise
  JsonValue inputs;  // object: all inputs of the result
  // If the recorded inputs differ: redo the stage, or refuse with the difference (for work that
  // a typing mistake should not discard).
  bool refuse_changes = false;
  std::string plan;                        // a clause for --dry-run: sizes and memory
  std::vector<std::string> plan_warnings;  // for --dry-run
  std::function<StageOutcome(const ProgressFunction&)> work;
};

class StageRunner {
 public:
  // `style` may be null where no stage of a style is run.
  StageRunner(Workspace* scene, Workspace* style, Console* console)
      : scene_(scene), style_(style), console_(console) {}

  // Forgets this stage and the later ones; an empty name forgets none.
  void RestartFrom(const std::string& stage);
  void SetDryRun(bool dry_run) { dry_run_ = dry_run; }
  // Expected seconds of the stages of this command, and of what follows them.
  void Expect(std::map<std::string, double> seconds, double later) {
    expected_ = std::move(seconds), later_ = later;
  }

  // False only in a dry run, when the stage would have to be done. Throws Error(kInput) for
  // refused changes, Interrupted, and what the work throws; running out of memory becomes
  // Error(kResources).
  bool Run(const Stage& stage);

  // For stages that this command does not run: returns the record. Throws Error(kInput) if
  // there is none or a result was changed; `how` names the command that runs the stage.
  StageRecord Require(const std::string& stage, const std::string& how) const;

 private:
  void ForgetAfter(const std::string& stage);
  Workspace* FolderOf(const std::string& stage) const {
    return IsOfScene(stage) ? scene_ : style_;
  }
  std::string Finished() const;
  std::string About(const std::string& stage) const;  // ", about 24 s", or nothing

  Workspace* scene_;
  Workspace* style_;
  Console* console_;
  bool dry_run_ = false;
  std::map<std::string, double> expected_;
  double later_ = 0;
  std::string planned_restart_;  // in a dry run nothing is forgotten
};

}  // namespace regrade
