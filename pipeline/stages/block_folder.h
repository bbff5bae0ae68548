// The files of a field that is refined in blocks: DIR/blocks/HASH/, HASH being that of what the
// blocks are made of.
//
//   inputs.json  see SharedWork
//   coarse.npz   the field that is refined
//   plan.json    see PlanBlocks; of whoever came first, and the same for all
//   00001.npz    field file of the splats that the plan's entry 1, 2, ... keeps: the blocks,
//                then their last turns
//   00001.json   BlockRecord of it, which is written last
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/run/run_context.h"
#include "pipeline/stages/block_plan.h"
#include "pipeline/workspace/shared_work.h"

namespace regrade {

struct BlockRecord {
  std::string device;
  double seconds = 0;
  double peak_memory_gb = 0;  // of the process, 10^9 bytes
  int photos = 0;
  int64_t splats = 0;  // kept
  int64_t pixels = 0;  // compared, over all steps
  int64_t rejected = 0;
  Metric psnr_train_db;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("device", device);
    visit("seconds", seconds);
    visit("peak_memory_gb", peak_memory_gb);
    visit("photos", photos);
    visit("splats", splats);
    visit("pixels", pixels);
    visit("rejected", rejected);
    visit("psnr_train_db", psnr_train_db);
  }
};

class BlockFolder {
 public:
  // Of the run's field and settings. Makes nothing. Throws Error(kInput) where the run has no
  // field of splats, or it was changed.
  BlockFolder(const RunContext& context, int blocks);

  const JsonValue& inputs() const { return work_->inputs(); }
  // Of all of them but the field.
  const std::string& settings() const { return settings_; }
  // Was the run's field made by these settings?
  bool IsJoined() const { return joined_; }
  const std::string& path() const { return work_->path(); }
  int blocks() const { return blocks_; }
  // The number of entries of the plan; while there is none, the number of blocks.
  int fits() const;
  std::string Path(const std::string& name) const { return work_->Path(name); }
  std::string OtherSettings() const { return work_->OtherSettings(); }
  std::string FieldPath(int block) const;  // block: from 0 on
  // Of who makes it, so that nobody else does at the same time.
  std::string LockPath(int block) const { return FieldPath(block) + ".lock"; }
  std::optional<BlockRecord> Find(int block) const;
  std::vector<int> Missing() const;

  // Makes the folder with inputs and the field, where they are missing.
  void Begin() const;
  // Of whoever wrote it first; empty before.
  std::optional<BlockPlan> Plan() const;
  BlockPlan KeepPlan(const BlockPlan& plan) const;
  void Record(int block, const BlockRecord& record) const;
  // Removes it all, once the field is made.
  void Drop() const { work_->Drop(); }

 private:
  std::string field_, settings_;
  int blocks_;
  bool joined_ = false;
  std::optional<SharedWork> work_;
};

// The name of its checkpoints.
inline std::string BlockStage(int block) { return Concat("block-", block + 1); }

// Where joining was interrupted after the field was replaced and before that was noted, puts
// the field before it back. Throws Error(kInput) where the field was changed otherwise.
void RepairField(const RunContext& context);

// "block 2", "last turn of block 2".
std::string BlockName(const BlockPlan& plan, int block);
// "blocks 2, 5, 7 of 8 and 3 last turns are missing", of the verbs " is missing" and
// " are missing"; counted from 1 here.
std::string BlocksText(const std::vector<int>& blocks, int all, const char* verb_of_one = "",
                       const char* verb_of_more = "");

}  // namespace regrade
