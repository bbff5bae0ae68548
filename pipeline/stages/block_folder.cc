#include "pipeline/stages/block_folder.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr char kField[] = "field.npz", kCoarse[] = "coarse.npz", kPlan[] = "plan.json";
constexpr uint64_t kMostField = uint64_t{64} << 30;

StageRecord RecordOf(const RunContext& context) {
  std::optional<StageRecord> record = context.workspace->Find("reconstruct");
  if (!record)
    throw InputError("stage reconstruct has not been done here", context.workspace->folder(),
                     "run `regrade reconstruct` first: its field is what is refined");
  return *std::move(record);
}

std::string FieldHash(const RunContext& context) {
  const StageRecord record = RecordOf(context);
  for (const StageOutput& output : record.outputs)
    if (output.path == kField) return output.hash;
  throw InputError("the record of stage reconstruct names no field",
                   context.workspace->folder(), "run `regrade reconstruct` again");
}

// A link where the file system has them.
void CopyFile(const std::string& from, const std::string& to) {
  const std::string made = OwnTemporary(to);
  std::error_code error;
  fs::remove(made, error);
  fs::create_hard_link(from, made, error);
  if (error) WriteFileAtomically(made, ReadWholeFile(from, kMostField));
  RenameDurably(made, to);
}

}  // namespace

BlockFolder::BlockFolder(const RunContext& context, int blocks)
    : field_(context.workspace->Path(kField)), blocks_(blocks) {
  const RunSettings& settings = context.settings;
  JsonValue inputs = JsonValue::Object{
      {"poses", context.ResultOf("pose")},        {"blocks", blocks},
      {"splats", OptionValues(settings.splats)},  {"photo-size", settings.scene.photo_size},
      {"holdout", settings.run.holdout},          {"seed", settings.run.seed},
      {"reproducible", settings.run.reproducible}};
  if (settings.run.reproducible) inputs["max-memory"] = settings.run.max_memory_gb;
  const StageRecord record = RecordOf(context);
  const JsonValue* const holdout = record.inputs.Find("holdout");
  if (holdout != nullptr && !(*holdout == JsonValue(settings.run.holdout)))
    throw UsageError(Concat("the field was fitted with ", holdout->AsInt()), "--holdout",
                     "leave it out: photos that were held out stay so");
  settings_ = HashText(HashOf(DumpJson(inputs, -1)));
  const ReconstructReport made = MetricsFromJson<ReconstructReport>(record.metrics);
  if (!made.splats)
    throw InputError("its field has voxels, and blocks are of splats",
                     context.workspace->folder(), "reconstruct it with --field splats");
  joined_ = made.refined && made.refined->settings == settings_;
  inputs["field"] = FieldHash(context);
  work_.emplace(context.workspace->Path(kBlocksFolder), std::move(inputs));
}

std::string BlockFolder::FieldPath(int block) const {
  return Path(Format("%05d.npz", block + 1));
}

std::optional<BlockRecord> BlockFolder::Find(int block) const {
  const std::string record = Path(Format("%05d.json", block + 1));
  if (!fs::exists(record)) return std::nullopt;
  return MetricsFromJson<BlockRecord>(ReadJsonFile(record));
}

int BlockFolder::fits() const {
  const std::optional<BlockPlan> plan = Plan();
  return plan ? static_cast<int>(plan->blocks.size()) : blocks_;
}

std::vector<int> BlockFolder::Missing() const {
  std::vector<int> missing;
  const int all = fits();
  for (int block = 0; block < all; ++block)
    if (!Find(block)) missing.push_back(block);
  return missing;
}

void BlockFolder::Begin() const {
  work_->Begin();
  if (!fs::exists(Path(kCoarse))) {
    if (HashFile(field_) != inputs().At("field").AsString())
      throw InputError("is not what stage reconstruct made", field_,
                       "run `regrade refine` without --part, which repairs what a kill left "
                       "half done, or `regrade reconstruct` again");
    CopyFile(field_, Path(kCoarse));
  }
}

std::optional<BlockPlan> BlockFolder::Plan() const {
  if (!fs::exists(Path(kPlan))) return std::nullopt;
  BlockPlan plan = PlanFromJson(ReadJsonFile(Path(kPlan)));
  if (std::ranges::count(plan.blocks, -1, &SpaceBlock::repeats) != blocks_)
    throw InputError("is not a plan of " + Counted(blocks_, "block"), Path(kPlan),
                     "remove this folder");
  return plan;
}

BlockPlan BlockFolder::KeepPlan(const BlockPlan& plan) const {
  const std::string made = OwnTemporary(Path(kPlan));
  WriteJsonFile(made, PlanToJson(plan));
  // A link is made where there is none yet, and otherwise not.
  std::error_code error;
  fs::create_hard_link(made, Path(kPlan), error);
  if (error && !fs::exists(Path(kPlan))) fs::rename(made, Path(kPlan));
  fs::remove(made, error);
  return *Plan();
}

void BlockFolder::Record(int block, const BlockRecord& record) const {
  WriteBesideOthers(Path(Format("%05d.json", block + 1)), MetricsToJson(record));
}

void RepairField(const RunContext& context) {
  const std::string field = context.workspace->Path(kField), hash = FieldHash(context);
  if (fs::exists(field) && HashFile(field) == hash) return;
  std::error_code error;
  for (const auto& entry :
       fs::directory_iterator(context.workspace->Path(kBlocksFolder), error)) {
    const fs::path coarse = entry.path() / kCoarse;
    if (!fs::exists(coarse) || HashFile(coarse.string()) != hash) continue;
    CopyFile(coarse.string(), field);
    return context.console->Info("the field is again what it was before it was joined");
  }
  throw InputError("is not what stage reconstruct made", field,
                   "run `regrade reconstruct` again");
}

std::string BlockName(const BlockPlan& plan, int block) {
  const int repeats = plan.blocks[static_cast<size_t>(block)].repeats;
  return repeats < 0 ? Concat("block ", block + 1) : Concat("last turn of block ", repeats + 1);
}

std::string BlocksText(const std::vector<int>& blocks, int all, const char* verb_of_one,
                       const char* verb_of_more) {
  constexpr size_t kNamed = 8;
  std::vector<std::string> names;
  for (const int block : blocks)
    if (block < all) names.push_back(std::to_string(block + 1));
  const size_t last_turns = blocks.size() - names.size();
  std::string text;
  if (!names.empty()) {
    text = names.size() == 1 ? "block " : "blocks ";
    if (names.size() > kNamed) names.resize(kNamed), names.push_back("...");
    text += Join(names, ", ") + Concat(" of ", all);
  }
  if (last_turns > 0) text += (text.empty() ? "" : " and ") + Counted(last_turns, "last turn");
  return text + (blocks.size() == 1 ? verb_of_one : verb_of_more);
}

}  // namespace regrade
