// Stage "render": frames of the field before and after styling, and of the 2D method applied to
// the former, at the photos' positions and along the film's camera path; and the films. Where
// photos differ in size or lens, the frames at their positions are rendered again with one
// common camera. The 2D method styles frames at the photos' positions, and of the film those on
// which it is measured.
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <utility>

#include "pipeline/fields/film_timing.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/frame_units.h"
#include "pipeline/stages/frame_writer.h"
#include "pipeline/stages/render_parts.h"
#include "pipeline/stages/scene_frames.h"
#include "pipeline/stages/seen_by_few_recorder.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/styled_field.h"
#include "pipeline/stages/styled_splats.h"
#include "pipeline/stages/videos.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

constexpr double kMuchSeenByFew = 0.2;  // of the film: worth a warning

void SayPlan(const FramePlan& plan, const RenderOptions& options, Console* console) {
  if (plan.path.narrowed)
    console->Info(
        "the film keeps close to the photos' places: a smoother path would pass through "
        "surfaces");
  if (plan.path.transmittance.value.value_or(1) < kClearTransmittance)
    console->Warn(
        "the film passes through surfaces, for photos were taken on both sides of them; "
        "--path views shows the photos' places one by one");
  if (const FrameSet* common = plan.common()) console->Info(ComparisonNote(common->cameras[0]));
  if (const std::string note = SmallerFilmNote(options, plan.path.film); !note.empty())
    console->Info(note);
}

// styled.ply of splats that were given.
void WriteStyledField(const RunContext& context, std::vector<std::string>* outputs) {
  const Workspace& style = *context.style;
  std::filesystem::remove(style.Path("styled.npz"));  // of an earlier version
  if (!HasGivenSplats(context)) {
    std::filesystem::remove(style.Path(kStyledSplats));  // of an earlier style
    return;
  }
  const StoredField plain = ReadFieldFile(context.workspace->Path("field.npz"));
  WriteStyledSplats(context, plain,
                    StyledFieldOf(plain, style.folder(), context.settings.style.strength));
  outputs->push_back(kStyledSplats);
}

// Frames and films of an earlier start.
void RemoveFrames(const FramePlan& plan, const Workspace& style) {
  std::filesystem::remove_all(style.Path("frames"));
  // This run's 2D method may not be able to style rendered frames.
  std::filesystem::remove(style.Path(kViews2dFilm));
  if (plan.film() != nullptr) return;
  for (const char* name : {kStyledFilm, kWipeFilm, kViews2dFilm})
    std::filesystem::remove(style.Path(name));
}

JoinedParts RenderAll(const FramePlan& plan, StoredField geometry, RunContext* context,
                      const ProgressFunction& progress, SceneFrames* frames,
                      SeenByFewRecorder* seen) {
  const RenderOptions& options = context->settings.render;
  const std::string& folder = context->style->folder();
  const std::vector<FrameUnit> units = UnitsOf(plan.sets);
  const auto tick = TickOf(units, progress);
  RunFilms films(folder, options.fps, plan.film_frames(),
                 plan.film_of_views() ? options.fps : kSampleRate);
  {
    FrameWriter writer(folder, ParseVignette(options.vignette), &films);
    bool begun = false;
    RenderUnits(units, std::move(geometry), *context, frames, [&](const FrameUnit& unit) {
      if (!std::exchange(begun, true)) RemoveFrames(plan, *context->style);
      RenderUnit(
          unit, *seen, tick, [&](SampledView view) { seen->Add(std::move(view)); }, frames,
          &writer);
      if (unit.end == static_cast<int>(unit.set->cameras.size())) seen->Finish(*unit.set);
    });
    writer.Finish();
  }
  JoinedParts rendered;
  if (plan.film() != nullptr) films.Finish(&rendered.films);
  if (!films.why_none().empty()) context->console->Warn("no film: " + films.why_none());
  rendered.device = frames->device();
  rendered.seconds = frames->seconds();
  return rendered;
}

RenderReport ReportOf(const FramePlan& plan, const JoinedParts& rendered,
                      const SeenByFewRecorder& seen, const RunSettings& settings) {
  RenderReport report;
  report.device = rendered.device;
  report.frames = plan.frames();
  report.path_frames = CountSamples(settings.render);
  report.film_frames = plan.film_frames();
  report.film_seconds = report.film_frames / settings.render.fps;
  report.path_transmittance = plan.path.transmittance;
  report.path_photo_distance = plan.path.photo_distance;
  if (const FrameSet* film = plan.film())
    report.film = {film->cameras[0].width, film->cameras[0].height};
  report.strength = settings.style.strength;
  if (rendered.seconds > 0) report.frames_per_second = report.frames / rendered.seconds;
  report.seen_by_few = seen.metrics();
  return report;
}

StageOutcome Render(const JsonValue& inputs, RunContext* context,
                    const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  const Workspace& style = *context->style;
  Console* const console = context->console;
  StoredField geometry = ReadFieldGeometry(context->workspace->Path("field.npz"));
  const FramePlan plan = PlanFrames(*context, geometry);
  SeenByFewRecorder seen(plan.views, plan.near);
  StageOutcome outcome;
  outcome.outputs = {"frames"};
  SayPlan(plan, settings.render, console);
  JoinedParts rendered;
  if (context->parts.Join()) {
    RemoveFrames(plan, style);
    rendered = JoinParts(inputs, plan, context, &seen);
  } else {
    SceneFrames frames(context, plan);
    rendered = RenderAll(plan, std::move(geometry), context, progress, &frames, &seen);
  }
  geometry = {};
  WriteStyledField(*context, &outcome.outputs);
  std::ranges::copy(rendered.films, std::back_inserter(outcome.outputs));
  WriteFrameNames(plan.views, style);
  const RenderReport report = ReportOf(plan, rendered, seen, settings);
  const std::string few = report.seen_by_few.Sentence();
  if (report.seen_by_few.film.value.value_or(0) > kMuchSeenByFew)
    console->Warn(few + ": it may look wrong there; more photos of these parts help");
  else if (!few.empty())
    console->Info(few);
  PutMetrics(report, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage RenderStage(RunContext* context) {
  Stage stage;
  stage.name = "render";
  stage.inputs = JsonValue::Object{
      {"field", context->ResultOf("reconstruct")},
      {"styled", context->ResultOf("stylize")},
      {"views_2d", context->ResultOf("style_2d")},
      {"strength", context->settings.style.strength},
      {"options", OptionValues(context->settings.scene, context->settings.render,
                               context->settings.style_2d)}};
  if (!context->settings.render.films.films) stage.inputs["films"] = false;
  if (context->workspace->Find("pose")) {
    const std::vector<FrameSet> sets = PlannedSets(*context);
    stage.plan = PlanOfFrames(sets);
    for (const FrameSet& set : sets)
      if (set.prefix == kFilmPrefix)
        if (const std::string note = SmallerFilmNote(context->settings.render, set.cameras);
            !note.empty())
          stage.plan += "; " + note;
    for (const FrameSet& set : sets)
      if (set.prefix == kCommonPrefix)
        stage.inputs["common_camera"] = ComparisonNote(set.cameras[0]);
  }
  stage.work = [context, inputs = stage.inputs](const ProgressFunction& progress) {
    return Render(inputs, context, progress);
  };
  return stage;
}

}  // namespace regrade
