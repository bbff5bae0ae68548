#include "pipeline/capture/polycam_cameras.h"

#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/capture/rigid_matrix.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

constexpr double kMaxPolycamSide = 1 << 16;  // pixels
constexpr uint64_t kMostPolycamBytes = 1 << 20;

double NumberOf(const std::string& path, const JsonValue& top, const std::string& key) {
  const JsonValue* value = top.Find(key);
  if (value == nullptr || !value->IsNumber() || !std::isfinite(value->AsDouble()))
    throw InputError(key + " is not a number", PlaceIn(path, value == nullptr ? top : *value));
  return value->AsDouble();
}

int SideOf(const std::string& path, const JsonValue& top, const std::string& key) {
  const double side = NumberOf(path, top, key);
  if (!(side >= 1 && side <= kMaxPolycamSide) || side != std::floor(side))
    throw InputError(key + " is not a number of pixels", PlaceIn(path, top.At(key)));
  return static_cast<int>(side);
}

}  // namespace

Camera ReadPolycamCamera(const std::string& path) {
  const JsonValue top = ReadJsonFile(path, kMostPolycamBytes);
  Camera camera;
  camera.width = SideOf(path, top, "width");
  camera.height = SideOf(path, top, "height");
  camera.fx = NumberOf(path, top, "fx");
  camera.fy = NumberOf(path, top, "fy");
  camera.cx = NumberOf(path, top, "cx");
  camera.cy = NumberOf(path, top, "cy");
  double rows[12];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) rows[4 * i + j] = NumberOf(path, top, Concat("t_", i, j));
  std::optional<RigidTransform> world_from_camera = RigidFromRows(rows);
  if (!world_from_camera)
    throw InputError("t_00 to t_23 are not a rotation and a translation", path);
  for (int i = 0; i < 3; ++i)
    for (const int j : {1, 2})
      world_from_camera->rotation(i, j) = -world_from_camera->rotation(i, j);
  camera.camera_from_world = world_from_camera->Inverse();
  if (const std::string implausible = ImplausibleCamera(camera); !implausible.empty())
    throw InputError("the camera has " + implausible, path);
  return camera;
}

}  // namespace regrade
