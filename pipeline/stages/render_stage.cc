// Stage "render": frames of the field before and after, and what the 2D method makes of the
// former, at the photos' places and along the film's way; and films.
#include <algorithm>
#include <filesystem>

#include "pipeline/camera_path.h"
#include "pipeline/capture_store.h"
#include "pipeline/device_choice.h"
#include "pipeline/field_file.h"
#include "pipeline/field_renderer.h"
#include "pipeline/files/image_file.h"
#include "pipeline/files/video_file.h"
#include "pipeline/photo_gains.h"
#include "pipeline/scene_views.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/run_context.h"
#include "pipeline/stages/scene_stylizer.h"

namespace regrade {
namespace {

// Left of the border the one, right of it the other; the border crosses the frame and returns.
Image Wiped(const Image& left, const Image& right, int frame, int frames) {
  const double phase = 2.0 * frame / std::max(1, frames - 1);
  const double share = phase <= 1 ? phase : 2 - phase;
  const int border = static_cast<int>(share * left.width);
  Image mixed = left;
  for (int y = 0; y < left.height; ++y)
    for (int x = border; x < left.width; ++x)
      std::copy_n(right.at(x, y), right.channels, mixed.at(x, y));
  return mixed;
}

// Films of frames that are on disk already, of the sequences `prefix` + "source" and "styled",
// and of "views_2d" where there is one. A machine without H.264 has none.
void WriteFilms(RunContext* context, const std::string& prefix, int frames,
                const ProgressFunction& progress, std::vector<std::string>* outputs) {
  const Workspace& workspace = *context->workspace;
  const auto frame = [&](const char* sequence, int i) {
    return ReadImage(workspace.Path("frames/" + prefix + sequence + "/" + FrameName(i)));
  };
  const Image first = frame("styled", 0);
  std::filesystem::remove(workspace.Path("views_2d.mp4"));  // of a method that had one
  try {
    VideoWriter film(workspace.Path("styled.mp4"), first.width, first.height,
                     context->settings.render.fps);
    VideoWriter wipe(workspace.Path("source_vs_styled.mp4"), first.width, first.height,
                     context->settings.render.fps);
    std::optional<VideoWriter> frame_by_frame;
    if (std::filesystem::exists(workspace.Path("frames/" + prefix + "views_2d")))
      frame_by_frame.emplace(workspace.Path("views_2d.mp4"), first.width, first.height,
                             context->settings.render.fps);
    for (int i = 0; i < frames; ++i) {
      if (Report(progress, i, frames, "films") == Verdict::kAbort) throw Interrupted();
      const Image styled = frame("styled", i), source = frame("source", i);
      if (!styled.SameSize(first)) {
        context->console->Info("no film: the photos have different sizes");
        return;
      }
      film.Add(styled);
      wipe.Add(Wiped(source, styled, i, frames));
      if (frame_by_frame) frame_by_frame->Add(frame("views_2d", i));
    }
    film.Finish();
    wipe.Finish();
    outputs->insert(outputs->end(), {"styled.mp4", "source_vs_styled.mp4"});
    if (frame_by_frame) {
      frame_by_frame->Finish();
      outputs->push_back("views_2d.mp4");
    }
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    context->console->Warn("no film: " + error.what_failed());
  }
}

// The two fields and the 2D method that frames are made with.
struct Studio {
  FieldRenderer source, styled;
  std::unique_ptr<ViewStylizer> stylizer;
  std::unique_ptr<CoverageRenderer> object;  // null where the whole scene is styled
  std::vector<Image> coverage;               // of the frame at hand
  double styled_seconds = 0;                 // spent in rendering the restyled field
};

// frames/<prefix>{source, styled, views_2d, transmittance}/<index>.png, as a camera of that
// gain shows them; views_2d for methods that can style a render
void RenderFrame(RunContext* context, Studio* studio, const Camera& camera,
                 const PhotoGain& gain, const std::string& prefix, int index) {
  Workspace& workspace = *context->workspace;
  RenderedView plain = studio->source.Render(camera);
  const double begin = context->console->StageSeconds();
  RenderedView restyled = studio->styled.Render(camera);
  studio->styled_seconds += context->console->StageSeconds() - begin;
  PutGain(gain, &plain.color);
  PutGain(gain, &restyled.color);
  const std::string folder = "frames/" + prefix, name = "/" + FrameName(index);
  WritePng8(workspace.NewPath(folder + "source" + name), plain.color);
  WritePng8(workspace.NewPath(folder + "styled" + name), restyled.color);
  if (studio->object != nullptr) studio->coverage = studio->object->Render(camera);
  if (studio->stylizer->StylesAnything())
    WritePng8(workspace.NewPath(folder + "views_2d" + name),
              studio->stylizer->Stylize(plain.color, index));
  // Where no scene is seen; evaluation leaves it out.
  WritePng8(workspace.NewPath(folder + "transmittance" + name), plain.transmittance);
}

StageOutcome Render(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  const StoredField before = ReadFieldFile(workspace.Path("field.npz"));
  const StoredField after = ReadFieldFile(workspace.Path("styled.npz"));
  const Backend backend = ChooseBackendFor(
      before.field.geometry->spheres.on(), settings.run.device, settings.run.reproducible,
      [context](const std::string& text) { context->console->Info(text); });
  Studio studio{FieldRenderer(before.field, backend),
                FieldRenderer(after.field, backend),
                nullptr,
                nullptr,
                {}};
  const std::unique_ptr<ObjectMasks> masks = OpenObjectMasks(settings, capture);
  if (masks != nullptr)
    studio.object = std::make_unique<CoverageRenderer>(
        before.field,
        ReadObjectFile(workspace.Path("object.npz"), before.field.geometry->num_voxels()));
  studio.stylizer = MakeSceneStylizer(context, capture, masks.get(),
                                      [&](const Image&, int) { return studio.coverage; });

  std::vector<Camera> views;
  for (const CaptureView& view : capture.views)
    views.push_back(WorkingCamera(view.camera, settings.scene.photo_size,
                                  before.field_from_world, before.ndc));
  const bool film_of_views = settings.render.path.path == "views";
  const std::vector<Camera> way =
      film_of_views ? std::vector<Camera>() : MakeCameraPath(views, settings.render.path);

  const PhotoGains gains =
      settings.render.keep_exposure ? RecordedGains(workspace, capture) : PhotoGains();
  std::filesystem::remove_all(workspace.Path("frames"));
  const int num_views = static_cast<int>(views.size()), num_way = static_cast<int>(way.size());
  constexpr double kFilms = 0.1;  // of the frames' time
  ProgressParts parts(progress, 1 + kFilms);
  const ProgressFunction frames_progress = parts.Next(1);
  for (int i = 0; i < num_views + num_way; ++i) {
    if (Report(frames_progress, i, num_views + num_way) == Verdict::kAbort) throw Interrupted();
    if (i < num_views)
      RenderFrame(context, &studio, views[static_cast<size_t>(i)], gains.Of(i), "", i);
    else
      RenderFrame(context, &studio, way[static_cast<size_t>(i - num_views)], kAsTaken,
                  kPathPrefix, i - num_views);
  }
  StageOutcome outcome;
  outcome.outputs = {"frames"};
  WriteFilms(context, film_of_views ? "" : kPathPrefix, film_of_views ? num_views : num_way,
             parts.Next(kFilms), &outcome.outputs);
  const int frames = num_views + num_way;
  outcome.figures["device"] = DeviceName(backend);
  outcome.figures["frames"] = frames;
  outcome.figures["path_frames"] = num_way;
  outcome.figures["frames_per_second"] =
      studio.styled_seconds > 0 ? JsonValue(frames / studio.styled_seconds) : JsonValue();
  return outcome;
}

}  // namespace

Stage RenderStage(RunContext* context) {
  Stage stage;
  stage.name = "render";
  stage.inputs =
      JsonValue::Object{{"field", context->ResultOf("reconstruct")},
                        {"styled", context->ResultOf("stylize")},
                        {"views_2d", context->ResultOf("style_2d")},
                        {"options", context->OptionsOf({"Scene", "Render", "2D method"})}};
  stage.work = [context](const ProgressFunction& progress) {
    return Render(context, progress);
  };
  return stage;
}

}  // namespace regrade
