// regrade run, pose, reconstruct: runs the pipeline from photos up to a given stage.
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/commands/command.h"
#include "pipeline/commands/probe_styles.h"
#include "pipeline/dry_run.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/records.h"
#include "pipeline/report/requirement_results.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run_pipeline.h"
#include "pipeline/stages/network_probe.h"
#include "pipeline/stages/scene_source.h"
#include "pipeline/workspace/stage_record.h"

namespace regrade {
namespace {

// Checks all inputs before long work starts.
void ProbeInputs(const std::string& command, RunContext* context) {
  if (!std::filesystem::exists(context->source))
    throw InputError("there is no such folder or film", context->source,
                     "name a folder of photos, a film or a file of splats");
  const std::filesystem::path out =
      std::filesystem::weakly_canonical(context->settings.run.out);
  const SceneSource& given = SourceOf(*context);
  given.probe(context);
  const std::string capture = given.capture(*context);
  const bool posed = !capture.empty() && DetectCapture(capture).kind == CaptureKind::kPosed;
  if (!posed && std::filesystem::weakly_canonical(context->source) == out)
    throw UsageError("is the folder of the photos", "--out",
                     "name another folder; it may be inside of that");
  for (const std::filesystem::path& folder : {out, out / "poses"})
    if (posed && std::filesystem::weakly_canonical(capture) == folder)
      throw UsageError(
          "is the capture itself, and would be overwritten", "--out",
          "name another folder; to continue this one, give the photos it was made of");
  if (std::string& masks = context->settings.pose.photo_masks; !masks.empty()) {
    HashFolder(masks);
    masks = AbsolutePath(masks);
  }
  if (std::string& network = context->settings.depth.network; !network.empty()) {
    network = AbsolutePath(network);
    ProbeDepthNetwork(network);
  }
  if (command != "run") return;
  ProbeStyles(&context->settings, context->console);
}

}  // namespace

void RunStages(const Command& command, const Arguments& arguments, Console* console) {
  const std::string name = command.name;
  RunContext context;
  context.console = console;
  context.settings.Bind(&context.options);
  const auto prepared = Prepare(command, arguments, {}, &context.options);
  if (!prepared) return;
  RunSettings& settings = context.settings;
  RequireValue(settings.run.out, "--out", "name the output folder");
  CheckTogether(settings);
  ChooseBackend(settings.run.device, settings.run.reproducible);
  context.source = AbsolutePath(prepared->words[0]);
  settings.run.out = AbsolutePath(settings.run.out);
  ProbeInputs(name, &context);
  const std::vector<NamedStyle> styles =
      name == "run" ? NameStyles(settings.run.out, settings.style.pictures, settings.style.name,
                                 settings.style.match.On())
                    : std::vector<NamedStyle>();

  const std::string last = name == "pose" ? "pose" : "reconstruct";
  if (settings.start.dry_run && !Workspace::Exists(settings.run.out)) {
    PlanNewScene(last, &context);
    if (name != "run") return SayPlan(context);
    return RunStyles("style_2d", styles, &context);
  }
  if (!settings.start.dry_run) BeginJUnit(settings.start.junit);
  Workspace workspace(settings.run.out);
  context.workspace = &workspace;
  console->OpenLog(workspace.Path(".regrade/log.txt"));
  // Later commands take their options from it, also after an interruption.
  const bool first_start = !std::filesystem::exists(workspace.Path("run.json"));
  if (first_start && !settings.start.dry_run) WriteRunFile(name, context);
  RunPipeline("pose", last, &context, static_cast<int>(styles.size()));
  if (!settings.start.dry_run) WriteRunFile(name, context);
  if (name == "run") return RunStyles("style_2d", styles, &context);
  if (settings.start.dry_run) return SayPlan(context);
  FinishRequirements(
      CheckRequirements(RequirementsOf(settings), ReportFromRecords(workspace, workspace)),
      settings.start.junit, console);
}

}  // namespace regrade
