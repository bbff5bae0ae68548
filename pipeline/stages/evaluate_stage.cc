// Stage "evaluate": temporal consistency of the rendered sequences, and beside it how much of
// the style they kept.
#include <optional>

#include "evaluate/consistency.h"
#include "evaluate/fidelity.h"
#include "evaluate/image_quality.h"
#include "evaluate/tables.h"
#include "kernels/field/fast_rays.h"
#include "kernels/field/render.h"
#include "pipeline/capture_store.h"
#include "pipeline/field_file.h"
#include "pipeline/files/image_file.h"
#include "pipeline/report_records.h"
#include "pipeline/scene_views.h"
#include "pipeline/stages/run_context.h"

namespace regrade {
namespace {

// Pictures `folder`/00000.png, ..., of the given views.
FrameSource FramesOf(const std::string& folder, const std::vector<int>& views) {
  return {static_cast<int>(views.size()), [folder, views](int i) {
            return ReadImage(folder + "/" + FrameName(views[static_cast<size_t>(i)]));
          }};
}

// The renderer's depth is along the optical axis; the evaluator wants it along each ray.
Image AlongRays(const Camera& camera, Image depth) {
  const Vec3d forward = camera.Forward();
  for (int y = 0; y < depth.height; ++y)
    for (int x = 0; x < depth.width; ++x) {
      const Vec3d ray = camera.PixelRay(x, y).direction.Cast<double>();
      *depth.at(x, y) = static_cast<float>(*depth.at(x, y) / Dot(ray, forward));
    }
  return depth;
}

// Depth and camera of each view, rendered when they are asked for.
GeometrySource GeometryOf(const RunSettings& settings, const Capture& capture,
                          const StoredField& stored) {
  const auto grid = std::make_shared<const FastGrid>(MakeFastGrid(stored.field));
  return [&settings, &capture, grid,
          field_from_world = stored.field_from_world](int i) -> FrameGeometry {
    const Camera camera = WorkingCamera(capture.views[static_cast<size_t>(i)].camera,
                                        settings.scene.photo_size, field_from_world);
    return {AlongRays(camera, RenderView(*grid, camera, MarchOptions{settings.fit.step}).depth),
            camera};
  };
}

StageOutcome Evaluate(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const Capture capture = ReadCapture(workspace.Path("poses"));
  const StoredField stored = ReadFieldFile(workspace.Path("field.npz"));
  std::vector<int> all(capture.views.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  const std::vector<int> fitted = ViewIndices(capture, settings.run.holdout, false);
  const auto frames = [&](const char* sequence, const std::vector<int>& views) {
    return FramesOf(workspace.Path(std::string("frames/") + sequence), views);
  };

  const FrameSource source = frames("source", all);
  const std::vector<NamedFrameSource> sequences = {{"source", source},
                                                   {"views_2d", frames("views_2d", all)},
                                                   {"styled", frames("styled", all)}};
  const GeometrySource geometry = settings.consistency.mode == "geometry"
                                      ? GeometryOf(settings, capture, stored)
                                      : GeometrySource();
  const ConsistencyReport consistency =
      EvaluateConsistency(source, sequences, settings.consistency, progress, geometry);

  // Fidelity is measured on the views that the style was learned from.
  const Image style = ReadStylePicture(settings.style.picture, nullptr);
  const FidelityTargets targets{frames("views_2d", fitted), frames("transmittance", fitted),
                                &style};
  std::vector<FidelityRow> fidelity;
  for (const NamedFrameSource& sequence : sequences)
    fidelity.push_back(MeasureFidelity({sequence.name, frames(sequence.name.c_str(), fitted)},
                                       targets, progress));
  const FidelityTargets photo_targets{FramesOf(workspace.Path("views_2d"), fitted),
                                      targets.transmittance, nullptr};
  const FidelityRow to_photos =
      MeasureFidelity({"styled", frames("styled", fitted)}, photo_targets, progress);

  context->console->Lines(FormatTables(consistency, fidelity));
  StageOutcome outcome;
  outcome.figures = EvaluationRecord(consistency, fidelity);
  outcome.figures["flow"] = settings.consistency.flow;
  outcome.figures["mask"] = settings.consistency.mode;
  outcome.figures["psnr_to_2d_photos_db"] =
      to_photos.psnr_to_2d_db ? JsonValue(*to_photos.psnr_to_2d_db) : JsonValue();
  return outcome;
}

}  // namespace

Stage EvaluateStage(RunContext* context) {
  Stage stage;
  stage.name = "evaluate";
  stage.inputs = JsonValue::Object{{"frames", context->ResultOf("render")},
                                   {"style", HashFile(context->settings.style.picture)},
                                   {"holdout", context->settings.run.holdout},
                                   {"options", context->OptionsOf({"Evaluation"})}};
  stage.work = [context](const ProgressFunction& progress) {
    return Evaluate(context, progress);
  };
  return stage;
}

}  // namespace regrade
