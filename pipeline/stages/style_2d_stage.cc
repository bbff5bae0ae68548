// Stage "style_2d": what the 2D method makes of each photo that it knows, in views_2d/.
#include <filesystem>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/image/color_statistics.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
#include "pipeline/fields/field_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/program/ordered_worker.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/make_stylizer.h"
#include "pipeline/stages/object_edit.h"
#include "pipeline/stages/stages.h"
#include "pipeline/stages/style_pictures.h"
#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/output_names.h"

namespace regrade {
namespace {

// The parts of photos that are masked, as the field shows them: neither the colours that a 2D
// method measures nor its pictures know what moved.
class MaskFiller {
 public:
  MaskFiller(const RunContext* context, const WorkingViews& views)
      : context_(context), views_(views) {}

  void Fill(int i, Image* photo) {
    const RunSettings& settings = context_->settings;
    const Image kept = views_.Mask(i);
    if (kept.empty()) return;
    if (!stored_) {
      stored_ = ReadFieldFile(context_->workspace->Path("field.npz"));
      renderer_.emplace(stored_->field,
                        ChooseBackend(settings.run.device, settings.run.reproducible));
    }
    const Camera camera = views_.InField(*stored_).CameraOf(i);
    FillMasked(kept, renderer_->Render(camera).color, photo);
  }

 private:
  const RunContext* context_;
  const WorkingViews& views_;
  std::optional<StoredField> stored_;
  std::optional<FieldRenderer> renderer_;
};

StageOutcome StyleViews(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->style;
  const WorkingViews views = context->Views();
  const Capture& capture = views.capture();
  const std::unique_ptr<ObjectMasks> masks = OpenObjectMasks(settings, views);
  const std::unique_ptr<ViewStylizer> stylizer = MakeSceneStylizer(context, views, masks.get());
  if (masks != nullptr && masks->num_known() < std::ssize(capture.views))
    context->console->Info(Concat(masks->num_known(), " of ",
                                  Counted(std::ssize(capture.views), "photo"),
                                  " have a mask; the style is learned from these"));
  const std::vector<std::string> notices = stylizer->Notices();
  for (const std::string& notice : notices) context->console->Info(notice);

  std::filesystem::remove_all(workspace.Path("views_2d"));
  MaskFiller filler(context, views);
  const int count = static_cast<int>(capture.views.size());
  int styled = 0;
  OrderedWorker writer;
  const auto is_known = [&](int64_t view) {
    const int i = static_cast<int>(view);
    return stylizer->Knows(i) && (masks == nullptr || masks->Knows(i));
  };
  const auto read = [&](int64_t view) {
    return is_known(view) ? views.Photo(static_cast<int>(view)) : Image();
  };
  MakeAhead(count, LargestPhotoBytes(views.capture()), read, [&](int64_t view, Image photo) {
    const int i = static_cast<int>(view);
    ReportOrThrow(progress, i, count);
    if (!is_known(i)) return;
    ++styled;
    filler.Fill(i, &photo);
    Image picture = stylizer->Stylize(photo, i);
    // A finished picture is one of the photo as it was taken.
    if (!stylizer->StylesAnything()) picture = views.AsSeen(i, std::move(picture));
    writer.Do([&workspace, i, picture = std::move(picture)] {
      WritePng8(workspace.NewPath("views_2d/" + FrameName(i)), picture);
    });
  });
  writer.Finish();
  StageOutcome outcome;
  outcome.outputs = {"views_2d"};
  PutMetrics(Style2dReport{{}, stylizer->Name(), styled, notices}, &outcome.metrics);
  return outcome;
}

}  // namespace

Stage Style2dStage(RunContext* context) {
  Stage stage;
  stage.name = "style_2d";
  stage.inputs = JsonValue::Object{
      {"poses", context->ResultOf("pose")},
      {"style", StyleFiles(context->settings.style)},
      {"options", OptionValues(context->settings.scene, context->settings.style_2d)}};
  const JsonValue files = MethodFiles(context->settings.style_2d);
  if (!files.IsNull()) stage.inputs["method_files"] = files;
  const JsonValue gains = StoredGainRows(context->workspace->Path("poses"));
  if (!gains.IsNull()) stage.inputs["exposure"] = gains;
  if (std::filesystem::is_directory(context->workspace->Path("poses/masks")) ||
      !context->settings.scene.Kind().lenses)
    stage.inputs["field"] = context->ResultOf("reconstruct");
  if (context->settings.object.On()) {
    stage.inputs["object"] = OptionValues(context->settings.object);
    stage.inputs["masks"] = MaskFiles(context->settings.object);
  }
  stage.work = [context](const ProgressFunction& progress) {
    return StyleViews(context, progress);
  };
  return stage;
}

}  // namespace regrade
