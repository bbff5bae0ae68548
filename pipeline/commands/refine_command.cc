// regrade refine: the field of a run in more detail, block by block.
#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/capture/effect_words.h"
#include "pipeline/commands/command.h"
#include "pipeline/files/text.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/block_fit.h"
#include "pipeline/stages/block_join.h"
#include "pipeline/workspace/folder_lock.h"
#include "pipeline/workspace/style_folders.h"

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
  for (int block = 0; block < folder.fits(); ++block) order.push_back(block);
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

// False where another process makes it, or has.
bool MakeBlock(const RunContext& context, const WorkingViews& views, const StoredField& coarse,
               const BlockFolder& folder, const BlockPlan& plan, int block,
               const ProgressFunction& progress) {
  std::optional<FolderLock> lock;
  try {
    lock.emplace(folder.LockPath(block), LockUse::kAlone);
  } catch (const Error& error) {
    if (error.code() != ExitCode::kFolderInUse) throw;
    context.console->Info(BlockName(plan, block) + " is being made by another process");
    return false;
  }
  if (folder.Find(block)) return false;
  FitBlock(context, views, coarse, folder, plan, block, progress);
  return true;
}

// Makes the part's blocks whose neighbours are there; says which are left.
void MakeBlocks(RunContext* context, const BlockFolder& folder) {
  Console* const console = context->console;
  folder.Begin();
  const StoredField coarse = ReadFieldFile(folder.Path("coarse.npz"));
  const WorkingViews views = context->Views().InField(coarse);
  if (views.capture().rendered)
    throw InputError("its splats were given without photos to fit them to",
                     context->workspace->folder(), "reconstruct a scene from photos");
  if (!context->settings.depth.network.empty())
    console->Info("blocks are fitted without the depths of --depth-network");
  console->BeginStage("refine", "refining the scene in blocks");
  const BlockPlan plan = PlanOf(*context, views, coarse, folder);
  std::vector<int> left = BlocksToMake(plan, folder, context->refine.part), made;
  ProgressParts parts(console->StageProgress(), static_cast<double>(left.size()));
  const auto ready = [&](int block) { return IsReady(block, plan, folder); };
  // Others may make meanwhile what a block waits for.
  for (auto next = std::ranges::find_if(left, ready); next != left.end();
       next = std::ranges::find_if(left, ready)) {
    const int block = *next;
    left.erase(next);
    if (MakeBlock(*context, views, coarse, folder, plan, block, parts.Next(1)))
      made.push_back(block);
  }
  console->EndStage();
  console->Info(made.empty() ? "refine: no block could be made now"
                             : BlocksText(made, folder.blocks()) + ": done in " +
                                   DurationText(console->StageSeconds()));
  if (!left.empty())
    console->Info(BlocksText(left, folder.blocks(), " waits", " wait") +
                  " for neighbours that other parts make: give the command again once they "
                  "have ended");
}

void Refine(RunContext* context) {
  const RefineOptions& refine = context->refine;
  Console* const console = context->console;
  const bool dry_run = context->settings.start.dry_run;
  if (!refine.One() && !dry_run) RepairField(*context);
  const BlockFolder folder(*context, refine.blocks);
  if (folder.IsJoined()) return console->Info("refine: done before");
  const std::vector<int> missing = folder.Missing();
  if (dry_run)
    return console->Info(missing.empty()
                             ? "refine: no block is left to make"
                             : "refine: would make " + BlocksText(missing, folder.blocks()));
  if (missing.empty() && refine.One())
    console->Info("refine: no block is left to make");
  else if (!missing.empty() && !refine.Join())
    MakeBlocks(context, folder);
  if (refine.One()) return;
  JoinBlocks(context, folder);
  const std::string& out = context->workspace->folder();
  if (const std::vector<std::string> styles = StyleNames(out); !styles.empty())
    console->Info("of the field before: " + Join(styles, ", ") + "; `regrade stylize " + out +
                  " --name NAME` makes each again");
  const int size = context->settings.scene.photo_size;
  const int64_t of_run =
      ReadRunFile(context->workspace->Path("run.json")).options.At("photo-size").AsInt();
  if (size != of_run)
    console->Info(Concat("later commands take photos of ", of_run,
                         " pixels from run.json: give them --photo-size ", size, ", too"));
}

}  // namespace

void RunRefine(const Command& command, const Arguments& arguments, Console* console) {
  RunContext context;
  context.console = console;
  context.options.Add("Blocks", &context.refine);
  context.settings.Bind(&context.options);
  const auto prepared = Prepare(command, arguments, {.continues_run = true}, &context.options);
  if (!prepared) return;
  RefuseRequirements(context.options);
  RunSettings& settings = context.settings;
  const RefineOptions& refine = context.refine;
  if (refine.One()) ParsePart(refine.part);
  if (!prepared->run_words.empty()) context.source = prepared->run_words[0];
  settings.run.out = AbsolutePath(prepared->words[0]);
  CheckTogether(settings);
  const auto effects = ParseEffects(settings.run.effects);
  if (const auto view = effects.find(kViewDependence); view != effects.end() && !view->second)
    settings.splats.sh_degree = 0;
  std::optional<Workspace> workspace;
  if (!refine.One())
    workspace.emplace(settings.run.out);
  else
    workspace.emplace(settings.run.out, Workspace::BesideOthers());
  context.workspace = &*workspace;
  console->OpenLog(workspace->Path(".regrade/log.txt"));
  Refine(&context);
}

}  // namespace regrade
