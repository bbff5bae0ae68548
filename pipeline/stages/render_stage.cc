// Stage "render": frames of the field before and after styling, and of the 2D method applied to
// the former, at the photos' positions and along the film's camera path; and the films. Where
// photos differ in size or lens, the frames at their positions are rendered again with one
// common camera. The film's frames may come from the fast renderer; those that are measured are
// exact. The 2D method styles frames at the photos' positions, and of the film those on which
// it is measured.
#include <algorithm>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>

#include "kernels/render/field_renderer.h"
#include "kernels/scene/common_camera.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/film_timing.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/carried_edit.h"
#include "pipeline/stages/film_frames.h"
#include "pipeline/stages/film_renderer.h"
#include "pipeline/stages/frame_writer.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/photo_vignette.h"
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

// The two fields and the 2D method.
struct FrameRenderers {
  std::optional<FieldRenderer> source, styled;
  std::unique_ptr<ViewStylizer> stylizer;
  std::unique_ptr<CoverageRenderer> object;  // null where the whole scene is styled
  std::vector<Image> coverage;               // of the current frame
  std::optional<CarriedEdit> edit;           // what single photos have beyond the 2D method
  double seconds = 0;                        // of rendering both fields
  bool fast_film = false;                    // both renderers are prepared for it
};

const FrameSet* CommonSet(const std::vector<FrameSet>& sets) {
  const auto common = std::find_if(sets.begin(), sets.end(), [](const FrameSet& set) {
    return set.prefix == kCommonPrefix;
  });
  return common == sets.end() ? nullptr : &*common;
}

// The way of the film, if there is one.
FilmPath PathOf(const WorkingViews& views, const RenderOptions& options,
                const RadianceField* field) {
  if (options.films.films) return MakeFilmPath(views, options, field);
  FilmPath path;
  path.transmittance = path.photo_distance = Metric::Undefined("films were left out");
  return path;
}

// The sets before there is a field: poses in the capture's world, final sizes.
std::vector<FrameSet> PlannedSets(const RunContext& context) {
  const WorkingViews views = context.Views();
  const RenderOptions& options = context.settings.render;
  return FrameSetsOf(views, options, PathOf(views, options, nullptr));
}

// The scene as a camera of that gain records it.
Frame RenderFrame(RunContext* context, FrameRenderers* renderers, const Camera& camera,
                  const PhotoGain& gain, int index, bool fast, bool with_2d) {
  const double begin = context->console->StageSeconds();
  const FieldRenderer &source = *renderers->source, &styled = *renderers->styled;
  RenderedPair pair =
      fast ? source.RenderFastWith(styled, camera) : source.RenderWith(styled, camera);
  renderers->seconds += context->console->StageSeconds() - begin;
  RenderedView& plain = pair.view;
  Frame frame;
  frame.styled = std::move(pair.other_color);
  frame.source = std::move(plain.color);
  frame.transmittance = std::move(plain.transmittance);
  frame.depth = std::move(plain.depth);
  PutGain(gain, &frame.source);
  PutGain(gain, &frame.styled);
  if (!with_2d) return frame;
  if (renderers->object != nullptr)
    renderers->coverage = renderers->object->Render(camera);
  else
    renderers->coverage = {CoverageOf(frame.transmittance)};
  if (renderers->stylizer->StylesAnything()) {
    frame.views_2d = renderers->stylizer->Stylize(frame.source, index);
    if (!renderers->edit->empty())
      frame.edited = renderers->edit->AddTo(camera, frame.depth, &*frame.views_2d);
    MixPicture(frame.source, context->settings.style.strength, &*frame.views_2d);
    // Nobody said what is wanted where the photo does not look: no difference is shown there.
    for (int64_t p = 0; p < frame.edited.num_pixels(); ++p)
      if (frame.edited.pixels[static_cast<size_t>(p)] == 0)
        std::copy_n(&frame.styled.pixels[static_cast<size_t>(3 * p)], 3,
                    &frame.views_2d->pixels[static_cast<size_t>(3 * p)]);
  }
  return frame;
}

// For the time that is left: a frame's pixels, of which those that are only in the film cost a
// third (pipeline/run/stage_estimate.cc).
double WorkOf(const FrameSet& set) {
  const Camera& camera = set.cameras[0];
  return 1e-6 * camera.width * camera.height * (set.prefix == kFilmPrefix ? 1.0 / 3 : 1);
}

// The renderers of the scene's field and of the style's. Fields have gigabytes: neither stays.
// Returns the writing of the styled splats, see WriteStyledSplats.
std::future<void> PrepareFields(const RunContext& context, Backend backend, StoredField before,
                                FrameRenderers* renderers, std::vector<std::string>* outputs) {
  const RunSettings& settings = context.settings;
  const Workspace& style = *context.style;
  renderers->source.emplace(before.field, backend);
  StoredField after = StyledFieldOf(std::move(before), style.folder(), settings.style.strength);
  const std::string kept = style.Path("styled.npz");
  if (settings.style.keep_field) {
    WriteFieldFile(kept, after);
    outputs->push_back("styled.npz");
  } else {
    std::filesystem::remove(kept);  // of an earlier style
  }
  renderers->styled.emplace(after.field, backend);
  std::future<void> splats = WriteStyledSplats(context, std::move(after));
  if (splats.valid()) outputs->push_back(kStyledSplats);
  return splats;
}

StageOutcome Render(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace &workspace = *context->style, &scene = *context->workspace;
  StoredField before = ReadFieldFile(scene.Path("field.npz"));
  const WorkingViews views = context->Views().InField(before);
  // In NDC the field's limit is no distance.
  SeenByFewRecorder seen(views, before.ndc.on() ? 0 : before.field.near_clip);
  const FilmPath path = PathOf(views, settings.render, &before.field);
  const std::unique_ptr<ObjectMasks> masks = OpenObjectMasks(settings, views);
  FrameRenderers renderers;
  if (masks != nullptr)
    renderers.object = std::make_unique<CoverageRenderer>(
        before.field,
        ReadObjectFile(workspace.Path("object.npz"), before.field.geometry->num_voxels()));
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  StageOutcome outcome;
  outcome.outputs = {"frames"};
  std::future<void> splats =
      PrepareFields(*context, backend, std::move(before), &renderers, &outcome.outputs);
  renderers.stylizer = MakeSceneStylizer(context, views, masks.get(),
                                         [&](const Image&, int) { return renderers.coverage; });
  renderers.edit.emplace(settings.residual, views, *renderers.source);

  if (path.narrowed)
    context->console->Info(
        "the film keeps close to the photos' places: a smoother path would pass through "
        "surfaces");
  if (path.transmittance.value.value_or(1) < kClearTransmittance)
    context->console->Warn(
        "the film passes through surfaces, for photos were taken on both sides of them; "
        "--path views shows the photos' places one by one");
  const std::vector<FrameSet> sets = FrameSetsOf(views, settings.render, path);
  int total = 0;
  double work = 0;
  for (const FrameSet& set : sets) {
    total += static_cast<int>(set.cameras.size());
    work += WorkOf(set) * static_cast<double>(set.cameras.size());
  }
  const auto film =
      std::find_if(sets.begin(), sets.end(), [](const FrameSet& set) { return set.of_film; });
  const bool has_film = film != sets.end();
  const int film_frames = has_film ? static_cast<int>(film->cameras.size()) : 0;
  const bool film_of_views = !has_film || film->of_photos;
  if (const FrameSet* common = CommonSet(sets))
    context->console->Info(ComparisonNote(common->cameras[0]));
  if (const std::string note = SmallerFilmNote(settings.render, path.film); !note.empty())
    context->console->Info(note);

  const std::string why_exact =
      PrepareFilm(settings, film_of_views, &*renderers.source, &*renderers.styled);
  renderers.fast_film = why_exact.empty();
  if (has_film)
    context->console->Detail("renderer of the film: " +
                             FilmRendererText(why_exact, *renderers.source));

  std::filesystem::remove_all(workspace.Path("frames"));
  if (!has_film)  // films of an earlier start
    for (const char* name : {kStyledFilm, kWipeFilm, kViews2dFilm})
      std::filesystem::remove(workspace.Path(name));
  RunFilms films(workspace, settings.render.fps, film_frames,
                 film_of_views ? settings.render.fps : kSampleRate);
  {
    FrameWriter writer(workspace, ParseVignette(settings.render.vignette), &films);
    double done = 0;
    for (const FrameSet& set : sets) {
      for (int i = 0; i < static_cast<int>(set.cameras.size()); ++i) {
        ReportOrThrow(progress, done, work);
        done += WorkOf(set);
        const auto frame = std::make_shared<const Frame>(RenderFrame(
            context, &renderers, set.cameras[static_cast<size_t>(i)],
            set.of_photos && settings.render.keep_exposure ? views.Gain(i) : kAsTaken, i,
            renderers.fast_film && set.prefix == kFilmPrefix, set.prefix != kFilmPrefix));
        seen.Add(set, i, frame->depth);
        writer.Write(frame, set, i);
      }
      seen.Finish(set);
    }
    writer.Finish();
  }
  WriteFrameNames(views, workspace);
  if (has_film) films.Finish(&outcome.outputs);
  if (splats.valid()) splats.get();
  if (!films.why_none().empty()) context->console->Warn("no film: " + films.why_none());
  RenderReport report;
  report.device = DeviceName(backend);
  report.frames = total;
  report.path_frames = CountSamples(settings.render);
  report.film_frames = film_frames;
  report.film_seconds = report.film_frames / settings.render.fps;
  report.path_transmittance = path.transmittance;
  report.path_photo_distance = path.photo_distance;
  if (has_film) report.film = {film->cameras[0].width, film->cameras[0].height};
  report.strength = settings.style.strength;
  if (has_film) report.film_renderer = FilmRendererText(why_exact, *renderers.source);
  if (renderers.seconds > 0) report.frames_per_second = total / renderers.seconds;
  report.seen_by_few = seen.metrics();
  const std::string few = report.seen_by_few.Sentence();
  if (report.seen_by_few.film.value.value_or(0) > kMuchSeenByFew)
    context->console->Warn(few + ": it may look wrong there; more photos of these parts help");
  else if (!few.empty())
    context->console->Info(few);
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
      {"keep_field", context->settings.style.keep_field},
      {"exact_film", WantsExactFilm(context->settings)},
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
    if (const FrameSet* common = CommonSet(sets))
      stage.inputs["common_camera"] = ComparisonNote(common->cameras[0]);
  }
  stage.work = [context](const ProgressFunction& progress) {
    return Render(context, progress);
  };
  return stage;
}

}  // namespace regrade
