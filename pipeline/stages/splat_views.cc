#include "pipeline/stages/splat_views.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/bare_cameras.h"
#include "pipeline/capture/capture_cameras.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/stages/foreign_splats.h"
#include "pipeline/stages/splat_points.h"
#include "pipeline/workspace/metrics_json.h"
#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/views/place_views.h"
#include "reconstruct/views/scene_up.h"

namespace regrade {
namespace {

// Films are at most as large as the pictures, and larger than the working size in this way by
// default.
constexpr double kFilmOverWorkingSize = 1.6;

// The pictures in `folder`, and the model of their cameras.
std::vector<StagedPhoto> RenderViews(const std::vector<BareCamera>& cameras,
                                     const FieldRenderer& renderer, const std::string& folder,
                                     const ProgressFunction& progress, ColmapModel* model) {
  std::vector<StagedPhoto> photos;
  std::vector<Image> rendered;  // not yet written
  const auto write = [&] {
    const int64_t first = std::ssize(photos) - std::ssize(rendered);
    ParallelTasks(0, std::ssize(rendered), [&](int64_t i) {
      WritePng8(photos[static_cast<size_t>(first + i)].path, rendered[static_cast<size_t>(i)]);
    });
    rendered.clear();
  };
  for (const auto& [name, camera] : cameras) {
    const size_t i = photos.size();
    ReportOrThrow(progress, static_cast<double>(i), static_cast<double>(cameras.size()));
    StagedPhoto photo;
    photo.file = name;
    photo.name = Format("%05zu.png", i);
    photo.path = folder + "/" + photo.name;
    photo.width = camera.width, photo.height = camera.height;
    rendered.push_back(renderer.Render(camera).color);
    const auto id = static_cast<uint32_t>(i + 1);
    model->cameras.push_back({id, ColmapLens::kPinhole, camera});
    model->images.push_back({id, id, photo.name, camera.camera_from_world, {}});
    photos.push_back(std::move(photo));
    const auto bytes = std::ssize(rendered[0].pixels) * static_cast<int64_t>(sizeof(float));
    if (std::ssize(rendered) >= TasksAtOnce(bytes)) write();
  }
  write();
  return photos;
}

StageOutcome PlaceViews(RunContext* context, const ProgressFunction& progress) {
  const RunSettings& settings = context->settings;
  Workspace& workspace = *context->workspace;
  const std::string photo_folder = workspace.Path("poses/photos"),
                    sparse_folder = workspace.Path("poses/sparse");
  std::filesystem::remove_all(photo_folder);  // of an earlier run
  for (const char* of_photos : {"poses/masks", "poses/depths"})
    std::filesystem::remove_all(workspace.Path(of_photos));
  workspace.NewPath("poses/photos/x");
  workspace.NewPath("poses/sparse/x");
  const SplatScene scene =
      ReadForeignSplats(context->source, settings.run.max_memory_gb, context->console);
  const RadianceField field = FieldInItsWorld(scene);
  const Backend backend = ChooseBackend(settings.run.device, settings.run.reproducible);
  const FieldRenderer renderer(field, backend);
  ProgressParts parts(progress, 2);
  const ProgressFunction placing = parts.Next(1);
  const std::string& given = settings.splat_input.cameras;
  const double longest = kFilmOverWorkingSize * settings.scene.photo_size;
  std::vector<BareCamera> cameras =
      given.empty() ? PlacedCameras(scene.splats, field, backend, settings.splat_input.up,
                                    static_cast<int>(std::lround(longest)), context->source,
                                    context->console, placing)
                    : ReadBareCameras(given);
  for (BareCamera& bare : cameras) bare.camera = ReducedTo(longest, bare.camera);
  ColmapModel model;
  const std::vector<StagedPhoto> photos =
      RenderViews(cameras, renderer, photo_folder, parts.Next(1), &model);
  WriteColmapModel(model, sparse_folder);
  Capture capture = CaptureFromModel(model, photos);
  capture.rendered = true;
  AddSplatPoints(field, renderer, sparse_folder, given.empty() ? context->source : given,
                 &capture);
  WriteCaptureIndex(workspace.Path("poses"), capture, photos);

  PoseStageReport metrics;
  metrics.given_poses = given;
  metrics.registered = static_cast<int>(capture.views.size());
  metrics.points = std::ssize(capture.points);
  metrics.reprojection_px = Metric::Undefined("there are no photos");
  metrics.models_found = 0;
  metrics.notices = {"there are no photos: " + Counted(std::ssize(photos), "picture") +
                     " of the splats take their places"};
  context->console->Info(metrics.notices[0]);
  StageOutcome outcome;
  outcome.outputs = {"poses"};
  PutMetrics(metrics, &outcome.metrics);
  return outcome;
}

JsonValue NumbersOf(const std::vector<BareCamera>& cameras) {
  JsonValue all = JsonValue::Array();
  for (const auto& [name, camera] : cameras) {
    JsonValue row = JsonValue::Array();
    row.Append(name);
    row.Append(camera.width), row.Append(camera.height);
    for (const double value : {camera.fx, camera.fy, camera.cx, camera.cy}) row.Append(value);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) row.Append(camera.camera_from_world.rotation(r, c));
      row.Append(camera.camera_from_world.translation[r]);
    }
    all.Append(std::move(row));
  }
  return all;
}

}  // namespace

bool HasPhotosOfSplats(const RunContext& context) {
  const std::string& cameras = context.settings.splat_input.cameras;
  if (cameras.empty() || !ReadBareCameras(cameras).empty()) return false;
  RequireCameras(context.Source(), cameras);
  return true;
}

CaptureSize SizeOfSplatViews(const RunContext& context) {
  CaptureSize size;
  const double longest = kFilmOverWorkingSize * context.settings.scene.photo_size;
  size.photos = kMostPlacedViews;
  size.width = static_cast<int>(longest), size.height = static_cast<int>(0.75 * longest);
  size.placed = true;
  const std::string& given = context.settings.splat_input.cameras;
  if (given.empty()) return size;
  const std::vector<BareCamera> cameras = ReadBareCameras(given);
  const Camera camera = ReducedTo(longest, cameras.at(0).camera);
  size.photos = std::ssize(cameras);
  size.width = camera.width, size.height = camera.height;
  return size;
}

Stage SplatViewsStage(RunContext* context) {
  const SplatInput& given = context->settings.splat_input;
  Stage stage;
  stage.name = "pose";
  stage.title = given.cameras.empty() ? "placing views" : "rendering the views of the cameras";
  stage.inputs = JsonValue::Object{{"splats", HashFile(context->source)},
                                   {"photo_size", context->settings.scene.photo_size}};
  if (given.cameras.empty())
    stage.inputs["up"] = given.up;
  else
    stage.inputs["cameras"] =
        HashText(HashOf(DumpJson(NumbersOf(ReadBareCameras(given.cameras)), -1)));
  stage.refuse_changes = true;
  stage.plan = "the splats of " + context->source + ", views " +
               (given.cameras.empty() ? "placed by measurement" : "from " + given.cameras);
  stage.work = [context](const ProgressFunction& progress) {
    return PlaceViews(context, progress);
  };
  return stage;
}

namespace {

Vec3d UpOf(const std::string& word) {
  Vec3d up;
  up[word.back() - 'x'] = word.front() == '-' ? -1 : 1;
  return up;
}

}  // namespace

std::vector<BareCamera> PlacedCameras(const Splats& splats, const RadianceField& field,
                                      Backend backend, const std::string& up, int longest,
                                      const std::string& where, Console* console,
                                      const ProgressFunction& progress) {
  const SceneUp chosen =
      up == "auto" ? EstimateUp(splats) : SceneUp{UpOf(up), "up is " + up + " by --up"};
  console->Info(chosen.why);
  const PlacedViews placed =
      PlaceViews(splats, field, backend, chosen.up, longest, where, progress);
  console->Info(placed.summary);
  std::vector<BareCamera> cameras;
  for (const int i : SmoothOrder(placed.cameras))
    cameras.push_back(
        {Format("view%02zu.png", cameras.size()), placed.cameras[static_cast<size_t>(i)]});
  return cameras;
}

Camera ReducedTo(double longest, const Camera& camera) {
  const double scale = std::min(1.0, longest / std::max(camera.width, camera.height));
  return camera.Resized(std::max(1, static_cast<int>(std::lround(camera.width * scale))),
                        std::max(1, static_cast<int>(std::lround(camera.height * scale))));
}

}  // namespace regrade
