#include "pipeline/dry_run.h"

#include <omp.h>

#include <algorithm>
#include <iterator>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/plan.h"
#include "pipeline/stages/scene_source.h"
#include "pipeline/stages/stages.h"
#include "pipeline/workspace/folder_size.h"

namespace regrade {
namespace {

// One photo of the source stands for all; where it cannot be read, its size is a phone's.
const CaptureSize& SizeOfSource(RunContext* context) {
  if (context->source_size) return *context->source_size;
  const SceneSource& given = SourceOf(*context);
  if (const auto size = given.size(*context)) return context->source_size.emplace(*size);
  const CaptureSource source = context->Source();
  const InputFiles inputs = InputsOf(source);
  CaptureSize size;
  size.photos = ExpectedPhotos(inputs, context->settings.ingest);
  size.placed = source.kind != CaptureKind::kPhotos;
  size.lacks_points =
      LacksPoints(source.kind) && context->settings.pose.tracks == "auto" && !given.has_points;
  for (const InputFile& input : inputs.files) {
    if (input.kind != InputKind::kPhoto || !input.file.problem.empty()) continue;
    try {
      const Image photo = DecodePhoto(input.file.path).image;
      size.width = photo.width, size.height = photo.height;
      break;
    } catch (const Error&) {  // said when the photos are read
    }
  }
  return context->source_size.emplace(size);
}

std::vector<StageEstimate> MeasuredStages(const Workspace& scene) {
  std::vector<StageEstimate> measured;
  for (const char* stage : kStageNames)
    if (IsOfScene(stage))
      if (const auto record = scene.Find(stage)) measured.push_back({stage, record->seconds});
  return measured;
}

JsonValue ToJson(const PlannedStage& planned) {
  JsonValue json = JsonValue::Object{
      {"stage", planned.stage}, {"done", planned.done}, {"seconds", planned.seconds}};
  if (!planned.style.empty()) json["style"] = planned.style;
  if (planned.memory > 0) json["memory"] = static_cast<int64_t>(planned.memory);
  return json;
}

// What the configurations ask for that auto takes of other captures than the base's.
void SayOtherConfigs(RunContext* context) {
  for (const char* name : {"llff", "syn"}) {
    RunSettings other = context->settings;
    OptionSet options;
    other.Bind(&options);
    ApplyPaperChoice({name, ""}, &options);
    std::string text = Concat("as ", name, ": ");
    for (const StageEstimate& stage : EstimateStages(
             other, SizeOfSource(context),
             ChooseBackend(other.run.device, other.run.reproducible), omp_get_max_threads()))
      if (stage.stage == "reconstruct" || stage.stage == "stylize")
        text += Concat(stage.stage == "stylize" ? ", " : "", stage.stage, " ",
                       PlanText({stage.memory, stage.seconds}));
    context->console->Info(text);
  }
}

// The poses decide which configuration auto takes; until then it is the base.
void SayPaperConfig(RunContext* context) {
  RunSettings& settings = context->settings;
  if (settings.run.preset != "paper") return;
  const bool asked = settings.run.paper_config != "auto";
  const std::string name = asked ? settings.run.paper_config : kPaperBase;
  ApplyPaperChoice({name, ""}, &context->options);
  context->console->Info("configuration of the paper: " + name +
                         (asked ? ", as paper-config says"
                                : ", unless the photos are transparent (syn) or all look one "
                                  "way (llff)"));
  if (!asked) SayOtherConfigs(context);
  for (const JsonValue& values :
       {DecidedValues(settings), RecipeValues(settings), ProtocolValues(settings)})
    for (const std::string& difference : NotToTheLetter(name, values))
      context->console->Info("not to the letter: " + difference);
}

}  // namespace

std::vector<StageEstimate> ExpectedStages(RunContext* context) {
  const RunSettings& settings = context->settings;
  const bool posed = context->workspace != nullptr && context->workspace->Find("pose");
  const CaptureSize size = posed ? SizeOfCapture(ReadCapture(context->workspace->Path("poses")))
                                 : SizeOfSource(context);
  std::vector<StageEstimate> stages = EstimateStages(
      settings, size, ChooseBackend(settings.run.device, settings.run.reproducible),
      omp_get_max_threads());
  if (const auto read_seconds = SourceOf(*context).read_seconds)  // no fit says how large it is
    for (StageEstimate& stage : stages) {
      stage.memory = 0;
      if (stage.stage == "reconstruct") stage.seconds = *read_seconds;
    }
  if (!posed) return stages;
  const double pace = MeasuredPace(stages, MeasuredStages(*context->workspace));
  for (StageEstimate& stage : stages) stage.seconds *= pace;
  return stages;
}

void PlanStages(const std::string& first, const std::string& last, const std::string& style,
                RunContext* context) {
  const std::vector<StageEstimate> stages = ExpectedStages(context);
  auto stage = std::ranges::find(stages, first, &StageEstimate::stage);
  for (; stage != stages.end(); ++stage) {
    const std::string memory =
        stage->memory > 0 ? ", about " + SizeText(stage->memory) + " of memory" : "";
    context->console->Info(stage->stage + ": would follow" + memory + ", about " +
                           DurationText(stage->seconds));
    context->planned.push_back({style, stage->stage, false, stage->seconds, stage->memory});
    if (stage->stage == last) break;
  }
}

void PlanStyles(const std::string& first, const std::vector<NamedStyle>& styles,
                RunContext* context) {
  for (const NamedStyle& style : styles) {
    context->console->Info("style " + style.name + ":");
    PlanStages(first, context->settings.start.until, style.name, context);
  }
}

void PlanNewScene(const std::string& last, RunContext* context) {
  RunSettings& settings = context->settings;
  context->console->Info(settings.run.out + " is new: every stage would run");
  SayPaperConfig(context);
  context->console->Info("from " + PoseStage(context).plan);
  PlanStages("pose", last, "", context);
  if (last == "pose" || SourceOf(*context).read_seconds) return;
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  const CaptureSize size = SizeOfSource(context);
  const std::string warning =
      MemoryWarning(settings, {.backend = backend,
                               .pixels = PixelsToFit(settings, size),
                               .photos = PhotosToFit(settings, size),
                               .max_memory_gb = settings.run.max_memory_gb,
                               .reproducible = settings.run.reproducible});
  if (!warning.empty()) context->console->Warn(warning);
}

void SayPlan(const RunContext& context) {
  const JsonValue values = context.options.Values(), setters = context.options.Setters();
  for (const auto& [name, by] : setters.AsObject())
    context.console->Detail(
        Concat(name, " ", DumpJson(values.At(name), -1), ": ", by.AsString()));
  double seconds = 0;
  JsonValue stages = JsonValue::Array();
  for (const PlannedStage& planned : context.planned) {
    stages.Append(ToJson(planned));
    if (!planned.done) seconds += planned.seconds;
  }
  context.console->Info(WouldWork(context) ? "about " + DurationText(seconds) + " in all"
                                           : "nothing would be done: all of it is there");
  context.console->Event("plan", JsonValue::Object{{"stages", stages}, {"seconds", seconds}});
}

bool WouldWork(const RunContext& context) {
  return !std::ranges::all_of(context.planned, &PlannedStage::done);
}

}  // namespace regrade
