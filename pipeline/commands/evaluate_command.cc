// regrade evaluate: metrics of a run, or of frames of any program.
#include <algorithm>
#include <filesystem>
#include <optional>

#include "evaluate/fidelity_networks.h"
#include "evaluate/pair_network.h"
#include "evaluate/protocols.h"
#include "evaluate/tables.h"
#include "kernels/base/error.h"
#include "pipeline/commands/continue_command.h"
#include "pipeline/commands/frame_folder.h"
#include "pipeline/commands/paired_benchmark.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/report/html.h"
#include "pipeline/report/json.h"
#include "pipeline/report/records.h"
#include "pipeline/report/requirements.h"
#include "pipeline/report/run_pictures.h"
#include "pipeline/run/run_settings.h"
#include "pipeline/stages/control_sequences.h"
#include "pipeline/stages/heat_map_files.h"
#include "pipeline/stages/network_probe.h"
#include "pipeline/workspace/metrics_json.h"

namespace regrade {
namespace {

struct FramesOptions {
  std::string frames, reference, target, style, pst50, out, protocol, table = "text", require;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("frames", frames,
         {.help =
              "folder with the styled frames and no other files; sorted by name, 9 before 10"});
    bind("reference", reference,
         {.help =
              "folder with the same frames before styling; motion and masks come from them"});
    bind("target", target,
         {.help = "folder with the 2D method's version of each frame, for fidelity"});
    bind("style", style, {.help = "style picture, for fidelity"});
    bind(
        "pst50", pst50,
        {.help = "folder of the 2D benchmark PST50: --frames has a method's picture of each of "
                 "its contents, of the same names, which are compared with paired_gt"});
    // Stands for other options, which ExpandProtocol() puts in its place.
    bind("protocol", protocol,
         {.help = "a published protocol by name, also for runs: sets --mode, --gaps and "
                  "--warp where it says so, and refuses others; geometry only for runs; "
                  "evaluate/PROTOCOLS.md defines each",
          .choices = ProtocolChoices()});
    bind("table", table,
         {.help = "form of the printed tables; latex needs the package booktabs",
          .choices = kTableForms});
    bind("require", require, {.help = kRequireHelp});
    bind("out", out,
         {.help = "folder for report.html, report.json and heatmaps/ of the worst pairs"});
  }
};

// Writes report.json, and a page with the metrics and the heat maps.
void WriteEvaluation(const Workspace& workspace, const RunReport& report) {
  WriteJsonFile(workspace.Path("report.json"), EvaluationJson(report));
  ReportPictures pictures;
  pictures.title = std::filesystem::path(workspace.folder()).filename().string();
  pictures.heat_maps = HeatMapPictures(workspace, report.evaluation);
  RunReport page = report;  // which has no run's command and stages
  page.command.clear();
  page.stages = {};
  WriteFileAtomically(workspace.Path("report.html"), ReportHtml(page, pictures));
}

// `words` are those of the command line.
void EvaluateFrames(const FramesOptions& frames, const ConsistencyOptions& options,
                    const Arguments& words, Console* console) {
  if (options.mode == "geometry")
    throw UsageError("geometry is known only for runs of regrade", "--mode",
                     "use lai2018 or ruder2016 for frames of other programs");
  if (options.control_field)
    throw UsageError("a field is fitted for runs of regrade only", "--control-field",
                     "leave it out, or evaluate the folder of a run");
  for (const auto& [flag, network] : {std::pair{"--style-features", options.style_features},
                                      {"--style-embedding", options.style_embedding}})
    if (!network.empty() && frames.style.empty())
      throw UsageError("distances to a style need its picture", flag, "add --style");
  if (!options.edges.empty() && frames.reference.empty())
    throw UsageError("edges are compared with the unstyled frames'", "--edges",
                     "add --reference");
  const std::vector<Requirement> required = ParseRequirements(frames.require, options.gaps);
  ProbeEvaluationNetworks(options);
  const bool has_reference = !frames.reference.empty();
  if (!has_reference)
    console->Warn("no --reference: motion is estimated from the styled frames themselves");
  console->BeginStage("frames");
  const auto open = [&](const std::string& folder) {
    FrameFolder frames = OpenFrameFolder(folder, console->StageProgress());
    if (!frames.notice.empty()) console->Warn(frames.notice);
    return frames;
  };
  const FrameFolder styled_folder = open(frames.frames);
  const FrameFolder reference_folder = has_reference ? open(frames.reference) : styled_folder;
  CheckSameFrames(reference_folder, styled_folder);
  if (styled_folder.paths.size() == 1)
    console->Warn("there is one frame only: consistency compares pairs, so it is not defined");
  const NamedFrameSource styled{"styled", styled_folder.Source()};
  const FrameSource reference = reference_folder.Source();
  std::vector<NamedFrameSource> sequences;
  FidelityTargets targets;
  if (has_reference) {
    sequences.push_back({"source", reference});
    targets.unstyled = reference;
  }
  if (!frames.target.empty()) {
    const FrameFolder target_folder = open(frames.target);
    CheckSameFrames(reference_folder, target_folder);
    targets.views_2d = target_folder.Source();
    sequences.push_back({"views_2d", targets.views_2d});
  }
  Image style;
  if (!frames.style.empty()) {
    style = ReadStylePicture(frames.style, nullptr);
    targets.style = &style;
  }
  sequences.push_back(styled);
  if (options.controls)
    for (NamedFrameSource& control : ControlSequences(
             {reference, styled.frames, targets.views_2d, targets.style, has_reference}))
      sequences.push_back(std::move(control));
  OpenNetworks(options, &targets);
  console->EndStage();
  std::optional<Workspace> workspace;  // before the work: the folder may be unusable
  if (!frames.out.empty()) workspace.emplace(frames.out);

  console->BeginStage("evaluate");
  const ConsistencyReport consistency =
      EvaluateConsistency(reference, sequences, options, console->StageProgress());
  const std::vector<FidelityRow> fidelity =
      MeasureFidelities(sequences, targets, console->StageProgress());
  const double seconds = console->StageSeconds();
  console->EndStage();
  std::vector<HeatMapFile> heat_maps;
  if (workspace) {
    BeginHeatMaps(*workspace);
    heat_maps = WriteHeatMaps(*workspace, sequences, consistency);
  }
  RunReport report;
  report.evaluation = MetricsOf(consistency, fidelity, heat_maps);
  report.version = REGRADE_VERSION;
  report.seconds = seconds;
  report.command = {"regrade", "evaluate"};
  report.command.insert(report.command.end(), words.begin(), words.end());
  report.stages.evaluate.emplace();
  report.stages.evaluate->time.seconds = seconds;
  report.stages.evaluate->flow = options.flow;
  report.stages.evaluate->mask = options.mode;
  report.stages.evaluate->warp = options.warp;
  report.stages.evaluate->error_per = options.error_per;
  report.stages.evaluate->protocol = ProtocolOf(options);
  if (workspace) WriteEvaluation(*workspace, report);
  console->Event("evaluation", MetricsToJson(report.evaluation));
  console->Lines(FormatTables(consistency, fidelity, frames.table));
  ThrowIfAny(FailedRequirements(required, report));
}

// Pictures of a 2D method against their ground truth; `words` are those of the command line.
void EvaluatePairs(const FramesOptions& frames, const ConsistencyOptions& options,
                   const Arguments& words, Console* console) {
  for (const auto& [flag, value] : {std::pair{"--reference", frames.reference},
                                    {"--target", frames.target},
                                    {"--style", frames.style},
                                    {"--require", frames.require},
                                    {"--edges", options.edges},
                                    {"--style-features", options.style_features},
                                    {"--style-embedding", options.style_embedding}})
    if (!value.empty())
      throw UsageError("pictures of PST50 are compared with its ground truth only", flag,
                       "leave it out");
  ProbeEvaluationNetworks(options);
  std::optional<Workspace> workspace;
  if (!frames.out.empty()) workspace.emplace(frames.out);
  console->BeginStage("evaluate");
  const std::vector<PairedRow> rows =
      MeasurePairedFolder({frames.pst50, frames.frames, options.controls},
                          PerceptualDistance(options.lpips), console->StageProgress());
  console->EndStage();
  JsonValue report = PairedJson(rows);
  console->Event("paired", report);
  JsonValue command = JsonValue::Array{"regrade", "evaluate"};
  for (const std::string& word : words) command.Append(word);
  report["regrade"] = REGRADE_VERSION;
  report["command"] = std::move(command);
  if (workspace) WriteJsonFile(workspace->Path("report.json"), report);
  console->Lines(FormatPairedTable(rows, frames.table));
}

}  // namespace

void RunEvaluate(const Command& command, const Arguments& words, Console* console) {
  const Arguments arguments = ExpandProtocol(words);
  FramesOptions frames;
  ConsistencyOptions consistency;
  ProgramOptions program;
  OptionSet options;
  options.Add("Frames", &frames);
  options.Add("Evaluation", &consistency);
  options.Add("Program", &program);
  // Without --frames it evaluates the folder of a run, with all of a run's options.
  const bool has_frames = std::ranges::any_of(arguments, [](const auto& word) {
    return word == "--frames" || word.starts_with("--frames=");
  });
  if (!has_frames && !AsksForHelp(arguments))
    return ContinueStyle(command, arguments, "evaluate", console);
  if (!Prepare(command, arguments, {.least_words = 0, .most_words = 0}, &options)) return;
  if (!frames.pst50.empty()) return EvaluatePairs(frames, consistency, words, console);
  EvaluateFrames(frames, consistency, words, console);
}

}  // namespace regrade
