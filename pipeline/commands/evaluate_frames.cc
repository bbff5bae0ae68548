#include "pipeline/commands/evaluate_frames.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <set>

#include "evaluate/fidelity_networks.h"
#include "evaluate/flow_folder.h"
#include "evaluate/pair_network.h"
#include "evaluate/paired_difference.h"
#include "evaluate/tables.h"
#include "kernels/base/error.h"
#include "pipeline/commands/frame_folder.h"
#include "pipeline/commands/frame_numbers.h"
#include "pipeline/commands/frame_pairing.h"
#include "pipeline/commands/given_geometry.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/images/image_file.h"
#include "pipeline/report/html.h"
#include "pipeline/report/json.h"
#include "pipeline/report/records.h"
#include "pipeline/report/requirement_results.h"
#include "pipeline/report/run_pictures.h"
#include "pipeline/stages/control_sequences.h"
#include "pipeline/stages/heat_map_files.h"
#include "pipeline/stages/network_probe.h"
#include "pipeline/workspace/metrics_json.h"

namespace regrade {
namespace {

void CheckTogether(const FramesOptions& frames, const ConsistencyOptions& options) {
  const bool geometry = options.mode == "geometry";
  if (geometry && (frames.cameras.empty() || frames.depth.empty() || frames.reference.empty()))
    throw UsageError("frames of other programs have no geometry of their own", "--mode",
                     "add --reference, --cameras and --depth, or use lai2018 or ruder2016");
  for (const auto& [flag, value] :
       {std::pair{"--cameras", frames.cameras}, {"--depth", frames.depth}})
    if (!geometry && !value.empty())
      throw UsageError("motion is estimated in mode " + options.mode, flag,
                       "leave it out, or use --protocol geometry");
  if (options.HasControlField())
    throw UsageError("a field is fitted for runs of regrade only", "--controls field",
                     "leave it out, or evaluate the folder of a run");
  if (!options.edges.empty() && frames.reference.empty())
    throw UsageError("edges are compared with the unstyled frames'", "edges",
                     "add --reference");
  if (frames.frames.size() > 1 && frames.reference.empty())
    throw UsageError("folders are compared by the motion of one reference", "--frames",
                     "add --reference, or give one folder");
  if (!frames.names.empty() && frames.names.size() != frames.frames.size())
    throw UsageError(
        Concat(frames.names.size(), " names for ", frames.frames.size(), " folders of frames"),
        "--name", "give one for each");
  if (std::set<std::string>(frames.names.begin(), frames.names.end()).size() !=
      frames.names.size())
    throw UsageError("two folders have the same name", "--name", "give each its own");
  if (!frames.junit.empty() && frames.require.empty())
    throw UsageError("there are no requirements to report", "--junit", "add --require");
}

struct Folders {
  std::vector<FrameFolder> styled;
  std::optional<FrameFolder> reference, target;

  // Motion comes from it.
  FrameFolder* Moving() { return reference ? &*reference : &styled[0]; }
};

Folders OpenFolders(const FramesOptions& frames, Console* console) {
  const auto open = [&](const std::string& folder) {
    FrameFolder opened = OpenFrameFolder(folder, console->StageProgress());
    if (!opened.notice.empty()) console->Warn(opened.notice);
    return opened;
  };
  Folders folders;
  for (const std::string& folder : frames.frames) folders.styled.push_back(open(folder));
  if (!frames.reference.empty()) folders.reference = open(frames.reference);
  if (!frames.target.empty()) folders.target = open(frames.target);
  return folders;
}

std::vector<FramePairing> Pair(Folders* folders, Console* console) {
  std::vector<FrameFolder*> sequences;
  for (FrameFolder& folder : folders->styled) sequences.push_back(&folder);
  if (folders->target) sequences.push_back(&*folders->target);
  std::vector<FramePairing> pairings = PairFolders(folders->Moving(), sequences);
  for (const FramePairing& pairing : pairings)
    if (!pairing.notice.empty()) console->Warn(pairing.notice);
  return pairings;
}

// What the files of --flow files:DIR call the frames that are compared: the numbers in the
// frames' names, or their places in the folder, whichever has the files.
std::vector<int64_t> FlowFrames(const ConsistencyOptions& options, const FrameFolder& frames,
                                Console* console) {
  const std::string prefix = kFlowFiles;
  if (!options.flow.starts_with(prefix)) return {};
  const std::vector<int64_t> places(frames.places.begin(), frames.places.end());
  std::vector<int64_t> numbers;
  for (const FrameNumber& number : FrameNumbers(frames.names)) numbers.push_back(number.number);
  if (numbers.empty() || numbers == places || numbers.size() < 2) return places;
  const std::string folder = options.flow.substr(prefix.size());
  const auto found = [&](const std::vector<int64_t>& called) {
    const FlowFolder files(folder, called);
    int count = 0;
    for (const int gap : options.gaps)
      for (int i = 0; i + gap < std::ssize(called); ++i) count += files.Has(i, i + gap);
    return count;
  };
  const int by_number = found(numbers), by_place = found(places);
  if (by_number != by_place) return by_number > by_place ? numbers : places;
  if (by_number == 0) return places;
  // Both are there: files that begin before the first number can only be places.
  const int64_t step = (numbers[1] - numbers[0]) / std::max<int64_t>(1, places[1] - places[0]);
  const bool before = FlowFolder(folder).LeastFrame() < numbers[0] - places[0] * step;
  console->Warn(
      Concat(folder, ": the flow of ", frames.names[0], " to ", frames.names[1],
             " is taken from the file of frames ", before ? places[0] : numbers[0], " and ",
             before ? places[1] : numbers[1],
             before ? ", their places in the folder" : ", the numbers in their names"));
  return before ? places : numbers;
}

// The sequences of the tables, and what they are measured by.
struct Measured {
  std::vector<NamedFrameSource> sequences;
  FidelityTargets targets;
  Image style;
  std::vector<MissingControl> missing;
};

void AddSequences(const FramesOptions& frames, const ConsistencyOptions& options,
                  Folders* folders, Measured* measured) {
  FidelityTargets& targets = measured->targets;
  const FrameSource reference = folders->Moving()->Source();
  if (folders->reference) {
    measured->sequences.push_back({"source", reference});
    targets.unstyled = reference;
  }
  if (folders->target) {
    targets.views_2d = folders->target->Source();
    measured->sequences.push_back({"views_2d", targets.views_2d});
  }
  if (!frames.style.empty()) {
    measured->style = ReadStylePicture(frames.style, nullptr);
    targets.style = &measured->style;
  }
  for (size_t i = 0; i < folders->styled.size(); ++i)
    measured->sequences.push_back({StyledName(i), folders->styled[i].Source()});
  OpenNetworks(options, &targets);
  if (!options.HasControls()) return;
  const bool has_reference = folders->reference.has_value();
  const ControlInputs inputs{reference, folders->styled[0].Source(), targets.views_2d,
                             targets.style, has_reference};
  std::ranges::move(ControlSequences(inputs), std::back_inserter(measured->sequences));
  const std::string why =
      has_reference ? WhyNoLinearMap(inputs) : "there are no unstyled frames (--reference)";
  if (!why.empty()) measured->missing.push_back({kLinearMapControl, why});
}

// Writes report.json, and a page with the metrics and the heat maps.
void WriteEvaluation(const Workspace& workspace, const RunReport& report,
                     const TableContext& context, const std::vector<std::string>& remarks,
                     const std::vector<FramePairing>& pairings) {
  JsonValue json = EvaluationJson(report);
  JsonValue::Array paired;
  for (const FramePairing& pairing : pairings)
    paired.push_back(JsonValue::Object{
        {"folder", pairing.folder},
        {"by", pairing.by},
        {"left_out", JsonValue::Array(pairing.left_out.begin(), pairing.left_out.end())},
        {"reference_left_out", JsonValue::Array(pairing.reference_left_out.begin(),
                                                pairing.reference_left_out.end())}});
  json["pairing"] = std::move(paired);
  for (const auto& [sequence, label] : context.labels) json["labels"][sequence] = label;
  if (!remarks.empty()) json["remarks"] = JsonValue::Array(remarks.begin(), remarks.end());
  WriteJsonFile(workspace.Path("report.json"), json);

  RunReport page = report;  // which has no run's command and stages
  page.command.clear();
  page.stages = {};
  const auto label = [&](std::string* sequence) {
    const auto found = context.labels.find(*sequence);
    if (found != context.labels.end()) *sequence = found->second;
  };
  for (auto& row : page.evaluation.consistency) label(&row.sequence);
  for (auto& row : page.evaluation.fidelity) label(&row.sequence);
  if (page.evaluation.warped)
    for (auto& row : *page.evaluation.warped) label(&row.sequence);
  ReportPictures pictures;
  pictures.title = std::filesystem::path(workspace.folder()).filename().string();
  pictures.heat_maps = HeatMapPictures(workspace, page.evaluation);
  WriteFileAtomically(workspace.Path("report.html"), ReportHtml(page, pictures));
}

EvaluateReport StageOf(const ConsistencyReport& consistency, const ConsistencyOptions& options,
                       double seconds) {
  EvaluateReport stage;
  stage.time.seconds = seconds;
  stage.flow = consistency.flow;
  stage.mask = options.mode;
  stage.warp = options.warp;
  stage.error_per = options.error_per;
  stage.protocol = ProtocolOf(options);
  return stage;
}

TableContext ContextOf(const FramesOptions& frames, const ConsistencyOptions& options,
                       const std::vector<MissingControl>& missing,
                       const std::vector<std::string>& remarks) {
  TableContext context;
  context.remarks = remarks;
  context.form = frames.format;
  context.protocol = ProtocolOf(options);
  context.version = REGRADE_VERSION;
  for (size_t i = 0; i < frames.names.size(); ++i)
    context.labels[StyledName(i)] = frames.names[i];
  for (const MissingControl& control : missing)
    context.remarks.push_back(control.sequence + ": left out, " + control.why);
  return context;
}

}  // namespace

std::string StyledName(size_t folder) {
  return folder == 0 ? "styled" : Concat("styled_", folder + 1);
}

void EvaluateFrames(const FramesOptions& frames, const ConsistencyOptions& given,
                    const Arguments& words, Console* console, const MakeFrames& make) {
  CheckTogether(frames, given);
  ConsistencyOptions options = given;
  const std::vector<Requirement> required =
      ParseRequirements(frames.require, options.gaps, static_cast<int>(frames.frames.size()));
  BeginJUnit(frames.junit);
  ProbeEvaluationNetworks(options);
  if (frames.reference.empty())
    console->Warn("no --reference: motion is estimated from the styled frames themselves");
  std::vector<std::string> remarks;
  if (make) {
    console->BeginStage("render");
    remarks = make();
    console->EndStage();
  }
  console->BeginStage("frames");
  Folders folders = OpenFolders(frames, console);
  const std::vector<FramePairing> pairings = Pair(&folders, console);
  if (folders.styled[0].paths.size() == 1)
    console->Warn("there is one frame only: consistency compares pairs, so it is not defined");
  options.flow_frames = FlowFrames(options, *folders.Moving(), console);
  GeometrySource geometry;
  std::vector<std::string> notices;
  if (options.mode == "geometry")
    geometry = GivenGeometry(frames.cameras, frames.depth, *folders.Moving(), &notices);
  for (const std::string& notice : notices) console->Warn(notice);
  Measured measured;
  AddSequences(frames, options, &folders, &measured);
  console->EndStage();
  std::optional<Workspace> workspace;  // before the work: the folder may be unusable
  if (!frames.out.empty()) workspace.emplace(frames.out);

  console->BeginStage("evaluate");
  ConsistencyReport consistency =
      EvaluateConsistency(folders.Moving()->Source(), measured.sequences, options,
                          console->StageProgress(), geometry);
  if (folders.styled.size() > 1) AddDifferences(StyledName(0), &consistency);
  const std::vector<FidelityRow> fidelity =
      MeasureFidelities(measured.sequences, measured.targets, console->StageProgress());
  const double seconds = console->StageSeconds();
  console->EndStage();
  std::vector<HeatMapFile> heat_maps;
  if (workspace) {
    BeginHeatMaps(*workspace);
    heat_maps = WriteHeatMaps(*workspace, measured.sequences, consistency);
  }
  RunReport report;
  report.evaluation = MetricsOf(consistency, fidelity, heat_maps);
  if (!measured.missing.empty()) report.evaluation.missing_controls = measured.missing;
  report.version = REGRADE_VERSION;
  report.seconds = seconds;
  report.command = {"regrade", "evaluate"};
  report.command.insert(report.command.end(), words.begin(), words.end());
  report.stages.evaluate = StageOf(consistency, options, seconds);
  const TableContext context = ContextOf(frames, options, measured.missing, remarks);
  if (workspace) WriteEvaluation(*workspace, report, context, remarks, pairings);
  console->Event("evaluation", MetricsToJson(report.evaluation));
  console->Lines(FormatTables(consistency, fidelity, context));
  FinishRequirements(CheckRequirements(required, report), frames.junit, console);
}

}  // namespace regrade
