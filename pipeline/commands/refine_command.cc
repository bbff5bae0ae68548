// regrade refine: the field of a run in more detail, block by block.
#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/commands/command.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/stages/block_fit.h"
#include "pipeline/stages/block_join.h"

namespace regrade {
namespace {

BlockPlan PlanOf(const RunContext& context, const WorkingViews& views,
                 const StoredField& coarse, const BlockFolder& folder) {
  if (auto plan = folder.Plan()) return *std::move(plan);
  const RunOptions& run = context.settings.run;
  return folder.KeepPlan(PlanBlocks(views, coarse, folder.blocks(),
                                    ChooseBackend(run.device, run.reproducible),
                                    context.console->StageProgress()));
}

// Blocks in their turns, dealt out to the parts: all work on each turn. Those that are there
// are left out.
std::vector<int> BlocksToMake(const BlockPlan& plan, const BlockFolder& folder,
                              const std::string& part) {
  std::vector<int> order;
  for (int block = 0; block < folder.blocks(); ++block) order.push_back(block);
  std::ranges::stable_sort(
      order, {}, [&](int block) { return plan.blocks[static_cast<size_t>(block)].turn; });
  const auto [number, parts] = part.empty() ? PartNumber() : ParsePart(part);
  std::vector<int> own;
  for (size_t i = static_cast<size_t>(number - 1); i < order.size();
       i += static_cast<size_t>(parts))
    if (!folder.Find(order[i])) own.push_back(order[i]);
  return own;
}

bool IsReady(int block, const BlockPlan& plan, const BlockFolder& folder) {
  return std::ranges::all_of(plan.blocks[static_cast<size_t>(block)].after,
                             [&](int before) { return folder.Find(before).has_value(); });
}

// Makes the part's blocks whose neighbours are there; says which are left.
void MakeBlocks(RunContext* context, const BlockFolder& folder) {
  Console* const console = context->console;
  folder.Begin();
  const StoredField coarse = ReadFieldFile(folder.Path("coarse.npz"));
  if (!coarse.field.geometry->splats.on())
    throw InputError("its field has voxels, and blocks are of splats",
                     context->workspace->folder(), "reconstruct it with --field splats");
  const WorkingViews views = context->Views().InField(coarse);
  console->BeginStage("refine", "refining the scene in blocks");
  const BlockPlan plan = PlanOf(*context, views, coarse, folder);
  std::vector<int> left = BlocksToMake(plan, folder, context->refine.part), made;
  ProgressParts parts(console->StageProgress(), static_cast<double>(left.size()));
  const auto ready = [&](int block) { return IsReady(block, plan, folder); };
  // Others may make meanwhile what a block waits for.
  for (auto next = std::ranges::find_if(left, ready); next != left.end();
       next = std::ranges::find_if(left, ready)) {
    FitBlock(*context, views, coarse, folder, plan, *next, parts.Next(1));
    made.push_back(*next);
    left.erase(next);
  }
  console->EndStage();
  console->Info(made.empty() ? "refine: no block could be made now"
                             : BlocksText(made, folder.blocks()) + ": done in " +
                                   DurationText(console->StageSeconds()));
  if (!left.empty())
    console->Info(BlocksText(left, folder.blocks()) +
                  " come after neighbours that other parts make: give the command again "
                  "once they have ended");
}

void Refine(RunContext* context) {
  const RefineOptions& refine = context->refine;
  Console* const console = context->console;
  if (refine.part.empty()) RepairField(*context);
  const BlockFolder folder(*context, refine.blocks);
  if (folder.IsJoined()) return console->Info("refine: done before");
  const std::vector<int> missing = folder.Missing();
  if (context->settings.start.dry_run)
    return console->Info(missing.empty()
                             ? "refine: no block is left to make"
                             : "refine: would make " + BlocksText(missing, folder.blocks()));
  if (missing.empty())
    console->Info("refine: no block is left to make");
  else if (!refine.join)
    MakeBlocks(context, folder);
  if (!refine.part.empty()) return;
  JoinBlocks(context, folder);
  // Later stages work at the size of the photos that the field was refined with.
  JsonValue run = ReadJsonFile(context->workspace->Path("run.json"));
  run["options"]["photo-size"] = context->settings.scene.photo_size;
  WriteJsonFile(context->workspace->Path("run.json"), run);
}

}  // namespace

void RunRefine(const Command& command, const Arguments& arguments, Console* console) {
  RunContext context;
  context.console = console;
  context.options.Add("Blocks", &context.refine);
  context.settings.Bind(&context.options);
  const auto prepared = Prepare(command, arguments, {.continues_run = true}, &context.options);
  if (!prepared) return;
  RunSettings& settings = context.settings;
  const RefineOptions& refine = context.refine;
  if (!refine.part.empty()) {
    ParsePart(refine.part);
    if (refine.join)
      throw UsageError("goes without --part", "--join",
                       "make every part first, then join them");
  }
  if (!prepared->run_words.empty()) context.source = prepared->run_words[0];
  settings.run.out = AbsolutePath(prepared->words[0]);
  CheckTogether(settings);
  if (settings.start.break_lock) Workspace(settings.run.out, true);
  std::optional<Workspace> workspace;
  if (refine.part.empty())
    workspace.emplace(settings.run.out);
  else
    workspace.emplace(settings.run.out, Workspace::BesideOthers());
  context.workspace = &*workspace;
  console->OpenLog(workspace->Path(".regrade/log.txt"));
  Refine(&context);
}

}  // namespace regrade
