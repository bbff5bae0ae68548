// regrade evaluate: the figures of a run, or of frames that any program has made.
#include <algorithm>

#include "evaluate/tables.h"
#include "kernels/base/error.h"
#include "pipeline/commands/folder_command.h"
#include "pipeline/files/image_file.h"
#include "pipeline/folder_listing.h"
#include "pipeline/report_json.h"
#include "pipeline/report_records.h"
#include "pipeline/run_settings.h"

namespace regrade {
namespace {

struct FramesOptions {
  std::string frames, reference, target, style, out;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("frames", frames, {.help = "folder of the styled frames, in natural order of names"});
    bind("reference", reference,
         {.help = "folder of the same frames without style: motion and masks come from them"});
    bind("target", target,
         {.help = "folder of what the 2D method made of each frame, for fidelity"});
    bind("style", style, {.help = "the style picture, for fidelity"});
    bind("out", out, {.help = "folder for report.json"});
  }
};

FrameSource FramesIn(const std::string& folder) {
  std::vector<std::string> paths;
  for (const ListedFile& file : ListFolder(folder).files)
    if (file.problem.empty()) paths.push_back(file.path);
  if (paths.empty()) throw Error(ExitCode::kInput, "there are no frames here", folder);
  return {static_cast<int>(paths.size()),
          [paths](int i) { return ReadImage(paths[static_cast<size_t>(i)]); }};
}

void EvaluateFrames(const FramesOptions& frames, const ConsistencyOptions& options,
                    Console* console) {
  if (options.mode == "geometry")
    throw Error(ExitCode::kUsage, "geometry is known of our own runs only", "--mode",
                "use lai2018 or ruder2016 for frames of other programs");
  const NamedFrameSource styled{"styled", FramesIn(frames.frames)};
  const bool has_reference = !frames.reference.empty();
  if (!has_reference)
    console->Warn("no --reference: motion is estimated from the styled frames themselves");
  const FrameSource reference = has_reference ? FramesIn(frames.reference) : styled.frames;
  std::vector<NamedFrameSource> sequences;
  if (has_reference) sequences.push_back({"source", reference});
  FidelityTargets targets;
  if (!frames.target.empty()) {
    targets.views_2d = FramesIn(frames.target);
    sequences.push_back({"views_2d", targets.views_2d});
  }
  Image style;
  if (!frames.style.empty()) {
    style = ReadStylePicture(frames.style, nullptr);
    targets.style = &style;
  }
  sequences.push_back(styled);

  console->BeginStage("evaluate");
  const ConsistencyReport consistency =
      EvaluateConsistency(reference, sequences, options, console->StageProgress());
  std::vector<FidelityRow> fidelity;
  for (const NamedFrameSource& sequence : sequences)
    fidelity.push_back(MeasureFidelity(sequence, targets, console->StageProgress()));
  console->EndStage();
  const JsonValue record = EvaluationRecord(consistency, fidelity);
  if (!frames.out.empty()) {
    Workspace workspace(frames.out);
    WriteJsonFile(workspace.Path("report.json"),
                  EvaluationJson(ReportOfEvaluation(record)));
  }
  console->Event("evaluation", record);
  console->Lines(FormatTables(consistency, fidelity));
}

}  // namespace

void RunEvaluate(const Command& command, const Arguments& arguments, Console* console) {
  FramesOptions frames;
  ConsistencyOptions consistency;
  ProgramOptions program;
  OptionSet options;
  options.Add("Frames", &frames);
  options.Add("Evaluation", &consistency);
  options.Add("Program", &program);
  if (PrintedHelp(command, arguments, options)) return;
  // Without --frames it is a run's folder, with all of a run's options.
  const bool foreign = std::any_of(arguments.begin(), arguments.end(), [](const auto& word) {
    return word == "--frames" || word.compare(0, 9, "--frames=") == 0;
  });
  if (!foreign) return ContinueRun(command, arguments, "evaluate", console);
  const Arguments words = options.Parse(arguments);
  options.ApplyFlags();
  CheckWords(command, words, 0, 0);
  ApplyProgramOptions(program);
  EvaluateFrames(frames, consistency, console);
}

}  // namespace regrade
