// The output folder of a run: locked, with a record of each finished stage and a checkpoint of
// the current one. All paths inside are relative: the folder can be moved between runs.
//
//   .regrade/lock               process that holds the folder
//   .regrade/stages/NAME.json   stage records
//   .regrade/checkpoints/NAME   state of interrupted stages
//   .regrade/log.txt            messages
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/stage_record.h"

namespace regrade {

enum class StageState {
  kDone,           // recorded, with the same inputs and unchanged results
  kNeverDone,      //
  kInputsDiffer,   // finished from other inputs; `why` lists the differences
  kResultsDiffer,  // a result was edited or deleted; `why` names it
};

struct StageStatus {
  StageState state = StageState::kNeverDone;
  std::vector<std::string> why;
};

// Creates it and those above it. Throws Error(kResources).
void MakeFolder(const std::string& folder);

class Workspace {
 public:
  // Creates the folder if it is new, locks it, and removes temporaries of interrupted writers.
  // Throws before any work: Error(kResources) if it cannot be written or is not a folder,
  // Error(kFolderInUse), Error(kInput) if it holds files under our names that we did not write,
  // links among its files (RefuseLinks), or stage records of an older schema.
  explicit Workspace(const std::string& folder);
  // For a process that works in a folder of its own below it, beside others like it: no run can
  // have the lock meanwhile, and nothing is removed. Throws the same, and Error(kInput) where
  // no run has worked.
  struct BesideOthers {};
  Workspace(const std::string& folder, BesideOthers);

  // True if a run has worked here. Changes nothing.
  static bool Exists(const std::string& folder);

  // Throws Error(kInput), which names it, for a link, a named pipe or a device among the files
  // of a run in `folder`, which may itself be a link. Those of its styles are their own
  // folders'.
  static void RefuseLinks(const std::string& folder);
  // For what only reads: RefuseLinks, and Error(kInput) for a result of these stages that is
  // not what was recorded. Stages without a record are not checked.
  static void CheckResults(const std::string& folder, const std::vector<std::string>& stages);

  const std::string& folder() const { return folder_; }
  std::string Path(const std::string& relative) const { return folder_ + "/" + relative; }
  // The same; creates the folders above it.
  std::string NewPath(const std::string& relative) const;

  StageStatus Status(const std::string& stage, const JsonValue& inputs) const;
  std::optional<StageRecord> Find(const std::string& stage) const;
  // Hashes the outputs and makes the record durable; drops the stage's checkpoint.
  void Record(const std::string& stage, const JsonValue& inputs,
              const std::vector<std::string>& outputs, double seconds, const JsonValue& metrics,
              std::optional<double> cpu_seconds = std::nullopt);
  // Drops the stage's record and checkpoint. Results stay until they are replaced.
  void Forget(const std::string& stage);
  // Of the stage's record.
  std::string StagePath(const std::string& stage) const;
  // Names of the recorded stages.
  std::vector<std::string> FinishedStages() const;

  // A checkpoint belongs to its inputs: with other inputs, or damaged, it is ignored.
  // `content`: its pieces in their order.
  void SaveCheckpoint(const std::string& stage, const JsonValue& inputs,
                      std::vector<std::string_view> content) const;
  std::optional<std::string> LoadCheckpoint(const std::string& stage,
                                            const JsonValue& inputs) const;
  void DropCheckpoint(const std::string& stage) const;
  // The newest one of a folder that another process may be working in, of whatever inputs.
  static std::optional<std::string> PeekCheckpoint(const std::string& folder,
                                                   const std::string& stage);

 private:
  void RefuseOlderRecords() const;
  std::string CheckpointPath(const std::string& stage) const;

  std::string folder_;  // absolute
  std::optional<FolderLock> lock_;
};

}  // namespace regrade
