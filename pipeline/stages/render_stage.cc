// Stage "render": frames of the field before and after, and what the 2D method makes of the
// former, at the photos' places and along the film's way; and films.
#include <filesystem>
#include <memory>
#include <optional>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/fields/field_renderer.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/program/ordered_worker.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/videos.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// The two fields and the 2D method that frames are made with.
struct Studio {
  FieldRenderer source, styled;
  std::unique_ptr<ViewStylizer> stylizer;
  std::unique_ptr<CoverageRenderer> object;  // null where the whole scene is styled
  std::vector<Image> coverage;               // of the frame at hand
  double styled_seconds = 0;                 // spent in rendering the restyled field
};

// A camera's frames as they are written.
struct Frame {
  Image source, styled, transmittance;
  std::optional<Image> views_2d;  // of methods that can style a render
};

// As a camera of that gain shows the scene.
Frame RenderFrame(RunContext* context, Studio* studio, const Camera& camera,
                  const PhotoGain& gain, int index) {
  Frame frame;
  RenderedView plain = studio->source.Render(camera);
  const double begin = context->console->StageSeconds();
  frame.styled = studio->styled.Render(camera).color;
  studio->styled_seconds += context->console->StageSeconds() - begin;
  frame.source = std::move(plain.color);
  frame.transmittance = std::move(plain.transmittance);
  PutGain(gain, &frame.source);
  PutGain(gain, &frame.styled);
  if (studio->object != nullptr) studio->coverage = studio->object->Render(camera);
  if (studio->stylizer->StylesAnything())
    frame.views_2d = studio->stylizer->Stylize(frame.source, index);
  return frame;
}

// Writes files and films while the next frames are rendered, on a thread for each half of the
// pictures and one for the films, which a GPU's frames would wait for.
class FrameWriter {
 public:
  FrameWriter(const Workspace& workspace, RunFilms* films)
      : workspace_(workspace), films_(films) {}

  // frames/<prefix>{source, styled, views_2d, transmittance}/<index>.png
  void Write(const std::shared_ptr<const Frame>& frame, const std::string& prefix, int index,
             bool of_film) {
    const auto write = [this, prefix, index](const char* sequence, const Image& image) {
      WritePng8(workspace_.NewPath("frames/" + prefix + sequence + "/" + FrameName(index)),
                image);
    };
    before_.Do([=] {
      write("source", frame->source);
      write("transmittance", frame->transmittance);  // evaluation looks away where it is high
    });
    after_.Do([=] {
      write("styled", frame->styled);
      if (frame->views_2d) write("views_2d", *frame->views_2d);
    });
    if (!of_film) return;
    film_.Do([=, this] {
      films_->Add(index, frame->source, frame->styled,
                  frame->views_2d ? &*frame->views_2d : nullptr);
    });
  }
  void Finish() {
    before_.Finish();
    after_.Finish();
    film_.Finish();
  }

 private:
  const Workspace& workspace_;
  RunFilms* films_;
  OrderedWorker before_, after_, film_;
};

StageOutcome Render(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  const StoredField before = ReadFieldFile(workspace.Path("field.npz"));
  const StoredField after = ReadFieldFile(workspace.Path("styled.npz"));
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
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
  StageOutcome outcome;
  outcome.outputs = {"frames"};
  RunFilms films(workspace, settings.render.fps, film_of_views ? num_views : num_way);
  {
    FrameWriter writer(workspace, &films);
    for (int i = 0; i < num_views + num_way; ++i) {
      if (Report(progress, i, num_views + num_way) == Verdict::kAbort) throw Interrupted();
      const bool of_view = i < num_views;
      const int index = of_view ? i : i - num_views;
      const auto& cameras = of_view ? views : way;
      writer.Write(std::make_shared<const Frame>(
                       RenderFrame(context, &studio, cameras[static_cast<size_t>(index)],
                                   of_view ? gains.Of(i) : kAsTaken, index)),
                   of_view ? "" : kPathPrefix, index, of_view == film_of_views);
    }
    writer.Finish();
  }
  films.Finish(&outcome.outputs);
  if (!films.why_none().empty()) context->console->Warn("no film: " + films.why_none());
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
