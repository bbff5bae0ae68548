#include "pipeline/stages/block_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/splats/cpu/seen_by_cameras.h"
#include "kernels/splats/population_change.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/fields/splat_checkpoint.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/program/memory.h"
#include "pipeline/run/fit_memory.h"
#include "pipeline/workspace/folder_lock.h"
#include "reconstruct/splats/fit_splats.h"

namespace regrade {
namespace {

SceneBox BoxOf(const StoredField& stored) {
  SceneBox box;
  const GridFrame& frame = stored.field.geometry->frame;
  box.center = frame.center;
  box.radius = frame.radius;
  box.near_clip = stored.field.near_clip;
  box.background = stored.field.background;
  return box;
}

// The photos of a block, and what of the splats around it they see.
struct BlockInput {
  SplatPhotos photos;
  std::vector<uint8_t> seen;  // [splats]
};

BlockInput ReadInput(const WorkingViews& views, const StoredField& around,
                     const std::vector<int>& of, Console* console,
                     const ProgressFunction& progress) {
  const SplatsView<float> splats = SplatsOf(around.field);
  const SplatOptions options = SplatOptionsOf(around.field);
  std::vector<std::string> notes;
  const std::vector<std::vector<SeenPoint>> points =
      PointsOfViews(views.capture(), of, around.field_from_world, &notes);
  for (const std::string& note : notes) console->Info(note);
  BlockInput input;
  std::vector<Camera> cameras;
  for (size_t v = 0; v < of.size(); ++v) {
    ReportOrThrow(progress, static_cast<double>(v), static_cast<double>(of.size()), "photos");
    const Image photo = views.PhotoToFit(of[v]);
    if (photo.empty()) continue;
    const Camera camera = views.CameraOf(of[v]);
    input.photos.Add({camera, &photo, points[v]});
    cameras.push_back(camera.Undistorted());
  }
  input.seen = SeenSplats(splats, cameras, options);
  if (input.photos.count() == 0)
    throw SceneError("the masks leave nothing of the photos that see a block", "",
                     "give fewer --blocks");
  return input;
}

// What a block's fit begins with: `coarse` with the neighbours before it as they became.
StoredField FieldAround(const StoredField& coarse, const BlockFolder& folder,
                        const BlockPlan& plan, size_t block) {
  std::vector<int> before = plan.blocks[block].after;
  if (before.empty()) return coarse;
  std::ranges::stable_sort(before, {},
                           [&](int b) { return plan.blocks[static_cast<size_t>(b)].turn; });
  Splats all(0, coarse.field.appearance.basis);
  all.background = coarse.field.background;
  AppendSplats(SplatsOf(coarse.field), &all);
  for (const int b : before) {
    const StoredField neighbor = ReadFieldFile(folder.FieldPath(b));
    const SplatsView<float> there = all.view(), refined = SplatsOf(neighbor.field);
    Splats next(0, all.basis), own(0, refined.basis);
    next.background = all.background;
    AppendSplats(
        there,
        [&](int64_t i) {
          return !Keeps(plan.blocks, static_cast<size_t>(b), there.mean + 3 * i);
        },
        &next);
    AppendSplats(refined, &own);
    PadBasis(std::max(next.basis, own.basis), &next);
    PadBasis(next.basis, &own);
    AppendSplats(own.view(), &next);
    all = std::move(next);
  }
  return {FieldOfSplats(all, coarse.field.geometry->frame, coarse.field.near_clip, -1),
          coarse.field_from_world, coarse.ndc};
}

}  // namespace

void FitBlock(const RunContext& context, const WorkingViews& views, const StoredField& coarse,
              const BlockFolder& folder, const BlockPlan& plan, int block,
              const ProgressFunction& progress) {
  const size_t own = static_cast<size_t>(block);
  const SpaceBlock& space = plan.blocks[own];
  const StoredField around = FieldAround(coarse, folder, plan, own);
  const RunSettings& settings = context.settings;
  Console* const console = context.console;
  const std::string stage = BlockStage(block);
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  ProgressParts parts(progress, 0.05 + 1);
  const BlockInput input = ReadInput(views, around, plan.views[own], console, parts.Next(0.05));

  const SplatsView<float> splats = SplatsOf(around.field);
  Splats start(0, splats.basis);
  start.background = splats.background;
  const auto is_held = [&](int64_t i) { return space.held.Contains(splats.mean + 3 * i); };
  AppendSplats(
      splats, [&](int64_t i) { return !is_held(i) && input.seen[static_cast<size_t>(i)] != 0; },
      &start);
  const int64_t frozen = start.count();
  AppendSplats(splats, is_held, &start);

  SplatFitOptions options = settings.splats;
  const double part_of_photos =
      static_cast<double>(input.photos.count()) / static_cast<double>(views.Training().size());
  options.steps = std::max(1, static_cast<int>(std::lround(options.steps * part_of_photos)));
  options.thousands *= static_cast<float>(space.share);
  options.seed = settings.run.seed + static_cast<uint64_t>(block);
  if (space.repeats >= 0) options.begin = kLastTurnBegin;
  // Few photos are the whole field's, so that blocks are alike where they meet.
  if (std::ssize(views.Training()) >= options.few_photos) options.few_photos = 0;
  // The process has the field twice besides: each is a sixth of what a fit has of a splat.
  const int64_t copies = backend == Backend::kCpu ? splats.count / 3 : 0;
  const FitPlace place{.backend = backend,
                       .pixels = input.photos.num_pixels(),
                       .photos = input.photos.count(),
                       .box = BoxOf(around),
                       .max_memory_gb = settings.run.max_memory_gb,
                       .reproducible = settings.run.reproducible,
                       .frozen_splats = frozen + copies,
                       .is_block = true};
  const PlannedSplatFit fit = SplatsWithinMemory(options, place, start.count() - frozen);
  console->Info(Concat(BlockName(plan, block), ": ", Counted(input.photos.count(), "photo"),
                       ", ", Format("%.0f", double{fit.options.thousands}),
                       " thousand splats among ", frozen, " of others, ", PlanText(fit.plan)));
  if (!fit.notice.empty())
    console->Info(fit.notice + "; with more --blocks each may have more");

  SplatFitState state = RefinementOf(std::move(start), frozen);
  std::string note;
  if (const auto bytes = context.workspace->LoadCheckpoint(stage, folder.inputs()))
    if (std::optional<SplatFitState> resumed = UnpackSplatFitState(*bytes, &note)) {
      console->Info(stage + ": continues from its checkpoint");
      state = std::move(*resumed);
    }
  SplatFitHooks hooks;
  hooks.progress = parts.Next(1);
  hooks.resume = &state;
  hooks.checkpoint = [&](const SplatFitState& at) {
    context.workspace->SaveCheckpoint(stage, folder.inputs(),
                                      PackSplatFitState(at, note).Pieces());
  };
  const SplatFitResult result =
      RefineSplats(input.photos, space.held, place.box, fit.options, hooks, backend);

  Splats kept(0, result.splats.basis);
  kept.background = result.splats.background;
  const SplatsView<float> fitted = result.splats.view();
  AppendSplats(
      fitted,
      [&](int64_t i) { return i >= frozen && Keeps(plan.blocks, own, fitted.mean + 3 * i); },
      &kept);
  const std::string made = OwnTemporary(folder.FieldPath(block));
  WriteFieldFile(made, {FieldOfSplats(kept, around.field.geometry->frame,
                                      around.field.near_clip, result.fit_pixel),
                        around.field_from_world, around.ndc});
  RenameDurably(made, folder.FieldPath(block));
  BlockRecord record;
  record.device = DeviceName(backend);
  record.seconds = result.seconds;
  record.peak_memory_gb = static_cast<double>(ReadMemoryStatus().peak_used) * 1e-9;
  record.photos = input.photos.count();
  record.splats = kept.count();
  record.pixels = result.pixels;
  record.rejected = result.rejected;
  record.psnr_train_db = result.psnr_train_db;
  folder.Record(block, record);
  context.workspace->DropCheckpoint(stage);
}

}  // namespace regrade
