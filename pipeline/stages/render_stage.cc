// Stage "render": frames of the field before and after, what the 2D method makes of the former,
// and two films.
#include <algorithm>
#include <filesystem>

#include "kernels/field/fast_rays.h"
#include "kernels/field/render.h"
#include "pipeline/capture_store.h"
#include "pipeline/field_file.h"
#include "pipeline/files/image_file.h"
#include "pipeline/files/video_file.h"
#include "pipeline/scene_views.h"
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

// Films of frames that are on disk already. A machine without H.264 has none.
void WriteFilms(RunContext* context, int frames, std::vector<std::string>* outputs) {
  const Workspace& workspace = *context->workspace;
  const auto frame = [&](const char* sequence, int i) {
    return ReadImage(workspace.Path(std::string("frames/") + sequence + "/" + FrameName(i)));
  };
  const Image first = frame("styled", 0);
  try {
    VideoWriter film(workspace.Path("styled.mp4"), first.width, first.height,
                     context->settings.render.fps);
    VideoWriter wipe(workspace.Path("source_vs_styled.mp4"), first.width, first.height,
                     context->settings.render.fps);
    for (int i = 0; i < frames; ++i) {
      const Image styled = frame("styled", i), source = frame("source", i);
      if (!styled.SameSize(first)) {
        context->console->Info("no film: the photos have different sizes");
        return;
      }
      film.Add(styled);
      wipe.Add(Wiped(source, styled, i, frames));
    }
    film.Finish();
    wipe.Finish();
    outputs->insert(outputs->end(), {"styled.mp4", "source_vs_styled.mp4"});
  } catch (const Error& error) {
    if (error.code() != ExitCode::kExternalProgram) throw;
    context->console->Warn("no film: " + error.what_failed());
  }
}

StageOutcome Render(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  const StoredField before = ReadFieldFile(workspace.Path("field.npz"));
  const StoredField after = ReadFieldFile(workspace.Path("styled.npz"));
  const FastGrid source = MakeFastGrid(before.field), styled = MakeFastGrid(after.field);
  const std::unique_ptr<ViewStylizer> stylizer = MakeSceneStylizer(context, capture);
  const MarchOptions march{settings.fit.step};

  std::filesystem::remove_all(workspace.Path("frames"));
  const int frames = static_cast<int>(capture.views.size());
  double render_seconds = 0;
  for (int i = 0; i < frames; ++i) {
    if (Report(progress, i, frames) == Verdict::kAbort) throw Interrupted();
    const Camera camera = WorkingCamera(capture.views[static_cast<size_t>(i)].camera,
                                        settings.scene.photo_size, before.field_from_world);
    const RenderedView plain = RenderView(source, camera, march);
    const double begin = context->console->StageSeconds();
    const RenderedView restyled = RenderView(styled, camera, march);
    render_seconds += context->console->StageSeconds() - begin;
    const std::string name = FrameName(i);
    WritePng8(workspace.NewPath("frames/source/" + name), plain.color);
    WritePng8(workspace.NewPath("frames/styled/" + name), restyled.color);
    WritePng8(workspace.NewPath("frames/views_2d/" + name), stylizer->Stylize(plain.color, i));
    // Where no scene is seen; evaluation leaves it out.
    WritePng8(workspace.NewPath("frames/transmittance/" + name), plain.transmittance);
  }
  StageOutcome outcome;
  outcome.outputs = {"frames"};
  WriteFilms(context, frames, &outcome.outputs);
  outcome.figures["frames"] = frames;
  outcome.figures["frames_per_second"] =
      render_seconds > 0 ? JsonValue(frames / render_seconds) : JsonValue();
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
