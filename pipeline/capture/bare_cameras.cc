#include "pipeline/capture/bare_cameras.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/given_colmap_model.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/rigid_matrix.h"
#include "pipeline/files/json_file.h"
#include "reconstruct/colmap/colmap_model.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMostCameraBytes = 64 << 20;

BareCamera CameraOf(const JsonValue& entry) {
  BareCamera bare{entry.At("img_name").AsString(), {}};
  Camera& camera = bare.camera;
  const auto size = [&entry](const char* key) {
    return static_cast<int>(std::clamp<int64_t>(entry.At(key).AsInt(), 0, 1 << 20));
  };
  camera.width = size("width"), camera.height = size("height");
  camera.fx = entry.At("fx").AsDouble(), camera.fy = entry.At("fy").AsDouble();
  camera.cx = 0.5 * camera.width, camera.cy = 0.5 * camera.height;
  const JsonValue::Array &rotation = entry.At("rotation").AsArray(),
                         &position = entry.At("position").AsArray();
  double rows[12] = {};
  if (rotation.size() != 3 || position.size() != 3)
    throw InputError("rotation or position does not have 3 rows", entry.Place());
  for (size_t r = 0; r < 3; ++r) {
    const JsonValue::Array& row = rotation[r].AsArray();
    if (row.size() != 3) throw InputError("a row of rotation is not 3 numbers", entry.Place());
    for (size_t c = 0; c < 3; ++c) rows[4 * r + c] = row[c].AsDouble();
    rows[4 * r + 3] = position[r].AsDouble();
  }
  const auto world_from_camera = RigidFromRows(rows);
  if (!world_from_camera) throw InputError("rotation is not a rotation", entry.Place());
  camera.camera_from_world = world_from_camera->Inverse();
  if (const std::string implausible = ImplausibleCamera(camera); !implausible.empty())
    throw InputError("the camera of " + bare.name + " has " + implausible, entry.Place());
  return bare;
}

// Whether the photos that go with the poses are there.
bool HasPhotos(const CaptureSource& source) {
  std::error_code none;
  return fs::is_directory(source.photos, none) && ExpectedPhotos(InputsOf(source), {}) > 0;
}

std::vector<BareCamera> CamerasOfModel(const fs::path& folder) {
  const ColmapModel model = ReadColmapModel(folder.string());
  std::vector<BareCamera> cameras;
  for (const ColmapImage& image : model.images)
    cameras.push_back({image.name, model.CameraOf(image).Undistorted()});
  return cameras;
}

std::vector<BareCamera> CamerasOfFolder(const fs::path& root) {
  std::error_code none;
  for (const fs::path& poses : {root / "poses", root})
    if (fs::is_regular_file(poses / "photos.json", none)) {
      const Capture capture = ReadCapture(poses.string());
      std::vector<BareCamera> cameras;
      if (capture.rendered)
        for (const CaptureView& view : capture.views)
          cameras.push_back({view.file, view.camera});
      return cameras;
    }
  const CaptureSource source = DetectCapture(root.string());
  if (source.kind != CaptureKind::kPhotos && HasPhotos(source)) return {};
  if (fs::is_regular_file(root / "cameras.json", none))
    return ReadCamerasJson((root / "cameras.json").string());
  for (const fs::path& model : {root, root / "sparse" / "0", root / "sparse"})
    if (HoldsColmapModel(model)) return CamerasOfModel(model);
  return {};
}

}  // namespace

std::vector<BareCamera> ReadCamerasJson(const std::string& path) {
  const JsonValue file = ReadJsonFile(path, kMostCameraBytes);
  if (!file.IsArray())
    throw InputError(
        "is not a list of cameras", path,
        "give a cameras.json of 3D Gaussian Splatting, or the folder of a capture");
  std::vector<BareCamera> cameras;
  for (const JsonValue& entry : file.AsArray()) cameras.push_back(CameraOf(entry));
  std::ranges::stable_sort(cameras, {}, &BareCamera::name);
  if (cameras.empty()) throw InputError("lists no camera", path);
  return cameras;
}

void WriteCamerasJson(const std::string& path, const std::vector<BareCamera>& cameras) {
  const auto list = [](const Vec3d& v) { return JsonValue::Array{v.x, v.y, v.z}; };
  JsonValue::Array entries;
  for (const auto& [name, camera] : cameras) {
    const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
    JsonValue::Array rotation;
    for (const Vec3d& row : world_from_camera.rotation.row) rotation.push_back(list(row));
    entries.push_back(JsonValue::Object{{"id", std::ssize(entries)},
                                        {"img_name", name},
                                        {"width", camera.width},
                                        {"height", camera.height},
                                        {"position", list(world_from_camera.translation)},
                                        {"rotation", std::move(rotation)},
                                        {"fx", camera.fx},
                                        {"fy", camera.fy}});
  }
  WriteJsonFile(path, std::move(entries));
}

std::vector<BareCamera> ReadBareCameras(const std::string& path) {
  std::error_code none;
  if (fs::is_regular_file(path, none)) return ReadCamerasJson(path);
  return fs::is_directory(path, none) ? CamerasOfFolder(path) : std::vector<BareCamera>();
}

}  // namespace regrade
