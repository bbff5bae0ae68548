#include "pipeline/run_pipeline.h"

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "kernels/base/error.h"
#include "pipeline/files/text.h"
#include "pipeline/report/assessment.h"
#include "pipeline/report/records.h"
#include "pipeline/report/requirement_results.h"
#include "pipeline/run/run_file.h"
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
// The code of stage NAME begins in pipeline/stages/NAME_stage.cc.
// clang-format off
constexpr StageEntry kStages[] = {
    // photos -> poses/: cameras and points by COLMAP or as given (reconstruct/colmap)
    {"pose", PoseStage},
    // poses/ -> field.npz: density and colour fitted to the photos (reconstruct/fit), whose
    // exposure is undone where they are read (pipeline/capture/working_views.h); the loss is in
    // kernels/field/render_ray.h, its total variation in kernels/field/cell_variation.h and, of
    // uniform fields, total_variation.h
    {"reconstruct", ReconstructStage},
    // photos + style picture -> views_2d/: each photo styled in 2D (stylize/image)
    {"style_2d", Style2dStage},
    // field.npz + views_2d/ -> network.npz: a network of bounded Lipschitz constant that maps
    // the field's colours (stylize/training); its loss is in
    // stylize/field/gradient_aggregation.h, its bound in stylize/field/lipschitz_network.h
    {"stylize", StylizeStage},
    // field.npz + network.npz -> frames/ (a ray in kernels/field/render_ray.h, the opacity of
    // its samples in kernels/field/volume_rendering.h), films (pipeline/images/video_writer.h)
    {"render", RenderStage},
    // frames/ -> consistency (evaluate/consistency.h) and fidelity (evaluate/fidelity.h)
    // metrics, heatmaps/
    {"evaluate", EvaluateStage},
    // all records -> report.json, report.html (pipeline/report)
    {"report", ReportStage},
};
// clang-format on

const StageEntry* Find(const std::string& name) {
  return std::find_if(std::begin(kStages), std::end(kStages),
                      [&name](const StageEntry& m) { return name == m.name; });
}

}  // namespace

bool RunPipeline(const std::string& first, const std::string& last, RunContext* context) {
  StageRunner runner(context->workspace, context->style, context->console);
  runner.SetDryRun(context->settings.start.dry_run);
  const StageEntry* const restart = Find(context->settings.start.restart_from);
  if (restart <= Find(last)) runner.RestartFrom(std::max(restart, Find(first))->name);
  for (const StageEntry* before = std::begin(kStages); before != Find(first); ++before)
    runner.Require(before->name, "regrade run");
  for (const StageEntry* entry = Find(first); entry != std::end(kStages); ++entry) {
    // In a dry run the stages after an undone one have no inputs yet.
    if (!runner.Run(entry->make(context))) {
      for (; last != entry->name; ++entry)
        context->console->Info(std::string(entry[1].name) + ": would follow");
      return false;
    }
    if (last == entry->name) break;
  }
  return true;
}

namespace {

// Four lines: where film and page are, how long it took, how it went, and what to do next.
void PrintSummary(RunReport report, const RunContext& context) {
  const Workspace &scene = *context.workspace, &style = *context.style;
  report.preset = context.settings.run.preset;
  for (const char* stage : kStageNames)
    if (const auto record = context.FolderOf(stage).Find(stage))
      report.seconds += record->seconds;
  const Assessment assessment = AssessmentOf(report);
  const bool film = std::filesystem::exists(style.Path(kStyledFilm));
  context.console->Info((film ? "film " + style.Path(kStyledFilm) + ", " : std::string()) +
                        "page " + style.Path("report.html"));
  context.console->Info("took " + DurationText(report.seconds) + "; the folder " +
                        scene.folder() + " has " + SizeText(SizeOnDisk(scene.folder())));
  context.console->Info(assessment.Line());
  context.console->Info("next: " + assessment.advice);
}

}  // namespace

void RunStyles(const std::string& first, const std::vector<NamedStyle>& styles,
               RunContext* context) {
  const StyleSource given = context->settings.style;
  const std::string& until = context->settings.start.until;
  if (Find(until) < Find(first))
    throw UsageError("stage " + until + " comes before " + first, "--until",
                     "leave it out, or use `regrade stylize`");
  const std::vector<Requirement> required = RequirementsOf(context->settings);
  std::vector<CheckedRequirement> checked;
  if (!context->settings.start.dry_run) BeginJUnit(context->settings.start.junit);
  for (size_t i = 0; i < styles.size(); ++i) {
    const auto& [name, pictures] = styles[i];
    const std::string folder = StyleFolder(context->workspace->folder(), name);
    if (styles.size() > 1)
      context->console->Info(Concat("style ", i + 1, " of ", styles.size(), ": ", name));
    if (context->settings.start.dry_run && !Workspace::Exists(folder)) {
      context->console->Info(folder + " is new: every stage of a style would run");
      continue;
    }
    Workspace workspace(folder, context->settings.start.break_lock);
    context->style = &workspace;
    context->settings.style.pictures = pictures;
    context->settings.style.name = name;
    // From its beginning on the folder belongs to this picture.
    if (!std::filesystem::exists(workspace.Path("run.json"))) WriteRunFile("run", *context);
    RunPipeline(first, until, context);
    if (!context->settings.start.dry_run) WriteRunFile("run", *context);
    if (!context->settings.start.dry_run && until == "report") {
      PublishStyle(context->workspace->folder(), name);
      const RunReport report = ReportFromRecords(*context->workspace, workspace);
      PrintSummary(report, *context);
      std::ranges::move(CheckRequirements(required, report, name),
                        std::back_inserter(checked));
    }
    context->style = nullptr;
    context->settings.style = given;
  }
  if (!context->settings.start.dry_run)
    FinishRequirements(checked, context->settings.start.junit, context->console);
}

}  // namespace regrade
