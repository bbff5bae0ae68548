#include "pipeline/run_pipeline.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <map>

#include "kernels/base/error.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/dry_run.h"
#include "pipeline/files/text.h"
#include "pipeline/program/memory.h"
#include "pipeline/report/assessment.h"
#include "pipeline/report/records.h"
#include "pipeline/report/requirement_results.h"
#include "pipeline/run/run_file.h"
#include "pipeline/stages/render_parts.h"
#include "pipeline/stages/run_facts.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/folder_size.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

struct StageEntry {
  const char* name;
  Stage (*make)(RunContext*);
};

// The stages of a run, in order; each reads the results of earlier ones from the output folder.
// The code of stage NAME begins in pipeline/stages/NAME_stage.cc. What is done before is known,
// and checkpoints are read, by pipeline/workspace/stage_runner.h; memory is planned in
// pipeline/run/fit_memory.h. Blocks of a larger field: pipeline/commands/refine_command.cc.
// clang-format off
constexpr StageEntry kStages[] = {
    // photos -> poses/: cameras and points by COLMAP, with the arguments of
    // reconstruct/colmap/colmap_strategies.h, or as given
    {"pose", PoseStage},
    // poses/ -> field.npz: voxels (reconstruct/fit) or splats (reconstruct/splats) fitted to the
    // photos, whose exposure is undone where they are read (pipeline/capture/photo_gains.h);
    // the loss of voxels is in kernels/field/render_ray.h, its total variation in
    // kernels/field/total_variation.h; that of splats is in kernels/image/picture_loss.h, its
    // regularizers in kernels/splats/splat_update.h, births in reconstruct/splats/population.h
    {"reconstruct", ReconstructStage},
    // photos + style picture -> views_2d/: each photo styled in 2D (stylize/image) by the method
    // that pipeline/stages/make_stylizer.h makes
    {"style_2d", Style2dStage},
    // field.npz + views_2d/ -> network.npz: a network of bounded Lipschitz constant that maps
    // the field's colours (stylize/training); its loss is in
    // stylize/field/gradient_aggregation.h, with the regularizer of
    // stylize/field/weight_update.h, its bound in stylize/field/lipschitz_network.h
    {"stylize", StylizeStage},
    // field.npz + network.npz -> frames/ (a pixel of splats in kernels/splats/compositing.h,
    // their colours in kernels/splats/splat_color.h, a ray through voxels in
    // kernels/field/render_ray.h), films (pipeline/images/video_writer.h), whose way keeps out
    // of surfaces (pipeline/fields/path_clearance.h)
    {"render", RenderStage},
    // frames/ -> consistency (evaluate/consistency.h) and fidelity (evaluate/fidelity.h)
    // metrics, heatmaps/
    {"evaluate", EvaluateStage},
    // all records -> report.json, report.html (pipeline/report); the scene -> scene.html, a
    // page to walk in (pipeline/page/make_page.h; splats in field_codec.h, styles in
    // style_codec.h; drawn by web/splats.js and web/blend_splats.glsl)
    {"report", ReportStage},
};
// clang-format on

const StageEntry* Find(const std::string& name) {
  return std::find_if(std::begin(kStages), std::end(kStages),
                      [&name](const StageEntry& m) { return name == m.name; });
}

}  // namespace

namespace {

// What the stages of one call take, and what comes behind them in this command.
void Expect(const std::string& first, const std::string& last, int styles_after,
            RunContext* context, StageRunner* runner) {
  const std::vector<StageEstimate> stages = ExpectedStages(context);
  std::map<std::string, double> seconds;
  for (const StageEntry* entry = Find(first); entry != std::end(kStages); ++entry) {
    seconds[entry->name] = SecondsOf(stages, entry->name, entry->name);
    if (last == entry->name) break;
  }
  runner->Expect(seconds,
                 styles_after * SecondsOf(stages, "style_2d", context->settings.start.until));
}

PlannedStage Planned(const Stage& stage, bool done, RunContext* context) {
  PlannedStage planned{IsOfScene(stage.name) ? "" : context->settings.style.name, stage.name,
                       done};
  for (const StageEstimate& estimate : ExpectedStages(context))
    if (estimate.stage == stage.name)
      planned.seconds = estimate.seconds, planned.memory = estimate.memory;
  return planned;
}

// The command that makes a stage which is missing.
std::string HowToMake(const char* stage, const RunContext& context) {
  if (IsOfScene(stage) || context.style == nullptr) return "regrade run";
  return "regrade stylize " + context.workspace->folder() + " --name " +
         context.settings.style.name;
}

// What belongs to photos by their names is looked for as soon as these are known: before a fit
// of hours, of which the style knows nothing. Throws Error(kInput).
void CheckPictureNames(const RunContext& context) {
  const RunSettings& settings = context.settings;
  if (settings.style.pictures.empty()) return;
  const std::vector<std::string> photos = FilesOf(context.Views().capture());
  const StyleMethod method = ParseStyleMethod(settings.style_2d);
  const bool from_folder = method.kind == StyleMethodKind::kFolder;
  for (const auto& [folder, what] : {std::pair{settings.object.masks, "mask"},
                                     {settings.residual.Layers(), "layer"},
                                     {from_folder ? method.argument : "", "picture"}})
    if (!folder.empty()) PicturesByPhotoName(folder, photos, what);
}

// Stages of one command keep the photos that they read, unless its memory is limited.
void KeepPhotos(RunContext* context) {
  constexpr int64_t kMost = int64_t{1} << 30, kOfFree = 8;
  const RunSettings& settings = context->settings;
  if (context->photos != nullptr || settings.run.max_memory_gb > 0) return;
  const int64_t free = static_cast<int64_t>(ReadMemoryStatus().available);
  context->photos = std::make_shared<KeptPhotos>(std::min(kMost, free / kOfFree));
}

}  // namespace

bool RunPipeline(const std::string& first, const std::string& last, RunContext* context,
                 int styles_after) {
  const bool dry_run = context->settings.start.dry_run;
  StageRunner runner(context->workspace, context->style, context->console);
  runner.SetDryRun(dry_run);
  const StageEntry* const restart = Find(context->settings.start.restart_from);
  if (restart <= Find(last)) runner.RestartFrom(std::max(restart, Find(first))->name);
  for (const StageEntry* before = std::begin(kStages); before != Find(first); ++before)
    runner.Require(before->name, HowToMake(before->name, *context));
  Expect(first, last, styles_after, context, &runner);
  KeepPhotos(context);
  for (const StageEntry* entry = Find(first); entry != std::end(kStages); ++entry) {
    const Stage stage = entry->make(context);
    const bool done = runner.Run(stage);
    if (dry_run) context->planned.push_back(Planned(stage, done, context));
    // In a dry run the stages after an undone one have no inputs yet.
    if (!done && last != entry->name)
      PlanStages(entry[1].name, last, context->planned.back().style, context);
    if (!done) return false;
    if (last == entry->name) break;
    if (stage.name == "pose") CheckPictureNames(*context);
  }
  if (const KeptPhotos* const photos = context->photos.get();
      photos != nullptr && photos->decoded() > 0)
    context->console->Detail(Concat("photos: ", photos->decoded(), " decoded, ",
                                    photos->taken(), " taken from memory"));
  return true;
}

namespace {

// Where film and page are, how long this command took for them, how it went, and what to do
// next.
void PrintSummary(const RunContext& context, double seconds) {
  const Workspace &scene = *context.workspace, &style = *context.style;
  const bool whole = context.settings.start.until == "report";
  std::vector<std::string> made;
  if (std::filesystem::exists(style.Path(kStyledFilm)))
    made.push_back("film " + style.Path(kStyledFilm));
  if (whole) made.push_back("page " + style.Path("report.html"));
  if (!made.empty()) context.console->Info(Join(made, ", "));
  context.console->Info("took " + DurationText(seconds) + "; the folder " + scene.folder() +
                        " has " + SizeText(SizeOnDisk(scene.folder())));
  if (!whole)
    return context.console->Info("next: `regrade evaluate " + scene.folder() + " --name " +
                                 context.settings.style.name +
                                 "` measures it and writes its page");
  const Assessment assessment = AssessmentOf(ReportOfRun(context));
  context.console->Info(assessment.Line());
  context.console->Info("next: " + assessment.advice);
}

// Before anything that is there is given up: are all parts there?
void PrepareJoin(RunContext* context) {
  const Stage stage = RenderStage(context);
  const StageEntry* const restart = Find(context->settings.start.restart_from);
  if (restart > Find(stage.name) &&
      context->style->Status(stage.name, stage.inputs).state == StageState::kDone)
    WarnOfOtherParts(stage.inputs, *context);
  else
    RequireParts(stage, *context);
}

// The stages of one style, in its folder; what became of the requirements.
std::vector<CheckedRequirement> RunStyle(const std::string& first, const std::string& folder,
                                         const std::vector<Requirement>& required,
                                         int styles_after, double begin, RunContext* context) {
  const RunSettings& settings = context->settings;
  const std::string &name = settings.style.name, &until = settings.start.until;
  Workspace workspace(folder);
  context->style = &workspace;
  // From its beginning on the folder belongs to this picture.
  if (!std::filesystem::exists(workspace.Path("run.json"))) WriteRunFile("run", *context);
  if (context->parts.Join()) PrepareJoin(context);
  RunPipeline(first, until, context, styles_after);
  if (context->parts.Join() && !settings.start.dry_run)
    DropParts(RenderStage(context).inputs, *context);
  std::vector<CheckedRequirement> checked;
  if (!settings.start.dry_run) {
    WriteRunFile("run", *context);
    if (Find(until) >= Find("render")) {
      PublishStyle(context->workspace->folder(), name);
      PrintSummary(*context, context->console->Seconds() - begin);
    }
    if (until == "report")
      checked =
          CheckRequirements(required, ReportFromRecords(*context->workspace, workspace), name);
  }
  context->style = nullptr;
  return checked;
}

}  // namespace

void RunStyles(const std::string& first, const std::vector<NamedStyle>& styles,
               RunContext* context) {
  const StyleSource given = context->settings.style;
  const StartOptions& start = context->settings.start;
  Console* const console = context->console;
  if (Find(start.until) < Find(first))
    throw UsageError("stage " + start.until + " comes before " + first, "--until",
                     "leave it out, or use `regrade stylize`");
  const std::vector<Requirement> required = RequirementsOf(context->settings);
  std::vector<CheckedRequirement> checked;
  if (!start.dry_run) BeginJUnit(start.junit);
  // Nothing can be said of a style's stages before the scene is done.
  const bool scene_first = WouldWork(*context);
  for (size_t i = 0; i < styles.size(); ++i) {
    const auto& [name, pictures] = styles[i];
    const std::string folder = StyleFolder(context->settings.run.out, name);
    if (start.dry_run && (scene_first || !Workspace::Exists(folder))) {
      PlanStyles(first, {styles[i]}, context);
      continue;
    }
    if (styles.size() > 1)
      console->Info(Concat("style ", i + 1, " of ", styles.size(), ": ", name));
    context->settings.style.pictures = pictures;
    context->settings.style.name = name;
    std::ranges::move(RunStyle(first, folder, required, static_cast<int>(styles.size() - i - 1),
                               i == 0 ? 0 : console->Seconds(), context),
                      std::back_inserter(checked));
    context->settings.style = given;
  }
  if (start.dry_run) return SayPlan(*context);
  if (styles.size() > 1) console->Info("took " + DurationText(console->Seconds()) + " in all");
  FinishRequirements(checked, start.junit, console);
}

void RunPart(const std::string& style, RunContext* context) {
  const std::string path = StyleFolder(context->settings.run.out, style);
  Workspace folder(path, Workspace::BesideOthers());
  context->style = &folder;
  context->settings.style.name = style;
  const StageRunner runner(context->workspace, context->style, context->console);
  for (const StageEntry* before = std::begin(kStages); before != Find("render"); ++before)
    runner.Require(before->name, HowToMake(before->name, *context));
  const Stage stage = RenderStage(context);
  if (folder.Status(stage.name, stage.inputs).state == StageState::kDone)
    context->console->Info("render: done before");
  else
    RenderPart(stage, context);
  context->style = nullptr;
}

}  // namespace regrade
