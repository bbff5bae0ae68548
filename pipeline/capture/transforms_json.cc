#include "pipeline/capture/transforms_json.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/capture/listed_pictures.h"
#include "pipeline/capture/rigid_matrix.h"
#include "pipeline/capture/transforms_split.h"
#include "pipeline/files/json_file.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxSide = 1 << 16;  // pixels

[[noreturn]] void Refuse(const std::string& path, const JsonValue& at,
                         const std::string& what) {
  throw InputError(what, PlaceIn(path, at));
}

// Intrinsics of one frame: its own members first, then those at the top of the file.
class FrameValues {
 public:
  FrameValues(const std::string& path, const JsonValue& top, const JsonValue& frame)
      : path_(path), top_(top), frame_(frame) {}

  const JsonValue* Find(const char* key) const {
    const JsonValue* own = frame_.Find(key);
    return own != nullptr ? own : top_.Find(key);
  }

  std::optional<double> Number(const char* key) const {
    const JsonValue* value = Find(key);
    if (value == nullptr || value->IsNull()) return std::nullopt;
    const double number = value->IsNumber() ? value->AsDouble() : NAN;
    if (!std::isfinite(number)) Refuse(path_, *value, std::string(key) + " is not a number");
    return number;
  }

  double NumberOr(const char* key, double otherwise) const {
    return Number(key).value_or(otherwise);
  }

  // A whole number of pixels; 0 if it is not given.
  int Side(const char* key) const {
    const std::optional<double> side = Number(key);
    if (!side) return 0;
    if (!(*side >= 1 && *side <= kMaxSide) || *side != std::floor(*side))
      Refuse(path_, *Find(key), std::string(key) + " is not a number of pixels");
    return static_cast<int>(*side);
  }

 private:
  const std::string& path_;
  const JsonValue& top_;
  const JsonValue& frame_;
};

void ReadLens(const std::string& path, const JsonValue& frame, const FrameValues& values,
              Camera* camera) {
  const double k1 = values.NumberOr("k1", 0), k2 = values.NumberOr("k2", 0);
  const double k3 = values.NumberOr("k3", 0), k4 = values.NumberOr("k4", 0);
  const double p1 = values.NumberOr("p1", 0), p2 = values.NumberOr("p2", 0);
  const JsonValue* named = values.Find("camera_model");
  const std::string model = named != nullptr && named->IsString() ? named->AsString() : "";
  const JsonValue* fisheye = values.Find("is_fisheye");
  if (model == "OPENCV_FISHEYE" ||
      (fisheye != nullptr && fisheye->IsBool() && fisheye->AsBool())) {
    camera->lens = LensModel::kFisheye;
    camera->distortion = {k1, k2, k3, k4};
    return;
  }
  for (const char* known :
       {"", "OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "FULL_OPENCV"})
    if (model == known) {
      if (k4 != 0) Refuse(path, frame, "a k4 without a fisheye lens is not supported");
      camera->lens = k3 != 0 ? LensModel::kFullOpenCv : LensModel::kOpenCv;
      if (k1 == 0 && k2 == 0 && k3 == 0 && p1 == 0 && p2 == 0)
        camera->lens = LensModel::kPinhole;
      camera->distortion = {k1, k2, p1, p2, k3};
      return;
    }
  Refuse(path, *named, "camera model \"" + model + "\" is not supported");
}

RigidTransform ReadPose(const std::string& path, const JsonValue& frame) {
  const JsonValue* matrix = frame.Find("transform_matrix");
  if (matrix == nullptr || !matrix->IsArray())
    Refuse(path, frame, "a frame has no transform_matrix");
  const JsonValue::Array& rows = matrix->AsArray();
  if (rows.size() != 4 && rows.size() != 3)
    Refuse(path, *matrix, "transform_matrix is not 4x4");
  double numbers[12];
  for (int i = 0; i < 3; ++i) {
    if (!rows[i].IsArray() || rows[i].AsArray().size() != 4)
      Refuse(path, rows[i], "a row of transform_matrix does not have 4 numbers");
    for (int j = 0; j < 4; ++j) {
      const JsonValue& value = rows[i].AsArray()[j];
      numbers[4 * i + j] = value.IsNumber() ? value.AsDouble() : NAN;
      if (!std::isfinite(numbers[4 * i + j]))
        Refuse(path, value, "this element of transform_matrix is not a number");
    }
  }
  const std::optional<RigidTransform> found = RigidFromRows(numbers);
  if (!found) Refuse(path, *matrix, "transform_matrix is not a rotation and a translation");
  const RigidTransform& world_from_gl = *found;
  // y and z of the camera change sign.
  RigidTransform world_from_camera = world_from_gl;
  for (int i = 0; i < 3; ++i)
    for (const int j : {1, 2}) world_from_camera.rotation(i, j) = -world_from_gl.rotation(i, j);
  return world_from_camera.Inverse();
}

// A member that names a file; empty if it is missing or null.
std::string NameIn(const std::string& path, const JsonValue& frame, const char* key) {
  const JsonValue* name = frame.Find(key);
  if (name == nullptr || name->IsNull()) return "";
  if (!name->IsString() || name->AsString().find('\0') != std::string::npos)
    Refuse(path, *name, std::string(key) + " is not a file's name");
  return name->AsString();
}

void CountRenamed(const std::string& name, const std::string& file, TransformsFile* result) {
  const std::string plain = fs::path(name).lexically_normal().generic_string();
  if (plain == file || WithoutPictureEnding(file) == plain || fs::path(name).is_absolute())
    return;
  if (result->renamed++ > 0) return;
  result->listed_name = name;
  result->real_name = file;
}

Camera ReadCamera(const std::string& path, const JsonValue& top, const JsonValue& frame,
                  const std::string& picture, const PictureSizeFunction& size_of) {
  const FrameValues values(path, top, frame);
  Camera camera;
  camera.camera_from_world = ReadPose(path, frame);
  camera.width = values.Side("w");
  camera.height = values.Side("h");
  bool size_known = true;
  if (camera.width == 0 || camera.height == 0) {
    if (!size_of) Refuse(path, frame, "the size of the pictures (w, h) is missing");
    size_of(picture, &camera.width, &camera.height);
    size_known = camera.width > 0 && camera.height > 0;
    if (!size_known) camera.width = camera.height = 1;
  }
  const std::optional<double> angle_x = values.Number("camera_angle_x");
  const std::optional<double> angle_y = values.Number("camera_angle_y");
  const auto focal = [](double side, double angle) {
    return 0.5 * side / std::tan(0.5 * angle);
  };
  camera.fx = values.NumberOr("fl_x", angle_x ? focal(camera.width, *angle_x) : 0);
  camera.fy = values.NumberOr("fl_y", angle_y ? focal(camera.height, *angle_y) : camera.fx);
  if (!(camera.fx > 0 && camera.fy > 0 && std::isfinite(camera.fx) && std::isfinite(camera.fy)))
    Refuse(path, frame, "the focal length (fl_x or camera_angle_x) is missing or not positive");
  camera.cx = values.NumberOr("cx", 0.5 * camera.width);
  camera.cy = values.NumberOr("cy", 0.5 * camera.height);
  ReadLens(path, frame, values, &camera);
  const std::string implausible = size_known ? ImplausibleCamera(camera) : "";
  if (!implausible.empty()) Refuse(path, frame, "the camera has " + implausible);
  return camera;
}

// The members of `camera` that frames may share.
JsonValue::Object Intrinsics(const std::string& path, const Camera& camera) {
  const auto& k = camera.distortion;
  JsonValue::Object object = {
      {"camera_model", "OPENCV"}, {"fl_x", camera.fx}, {"fl_y", camera.fy},
      {"cx", camera.cx},          {"cy", camera.cy},   {"w", camera.width},
      {"h", camera.height},       {"k1", k[0]},        {"k2", k[1]}};
  if (camera.lens == LensModel::kFisheye) {
    object[0].second = "OPENCV_FISHEYE";
    object.emplace_back("k3", k[2]);
    object.emplace_back("k4", k[3]);
    return object;
  }
  object.emplace_back("p1", k[2]);
  object.emplace_back("p2", k[3]);
  if (k[5] != 0 || k[6] != 0 || k[7] != 0)
    throw InputError("transforms.json cannot hold a lens with k4, k5 or k6", path,
                     "undistort the pictures first");
  if (k[4] != 0) object.emplace_back("k3", k[4]);
  return object;
}

}  // namespace

TransformsFile ReadTransformsJson(const std::string& path, const PictureSizeFunction& size_of,
                                  bool may_be_empty) {
  const JsonValue top = ReadJsonFile(path);
  const JsonValue* frames = top.Find("frames");
  if (frames == nullptr || !frames->IsArray())
    Refuse(path, top, "this is not a transforms.json: it has no list \"frames\"");
  const fs::path folder = fs::path(path).parent_path();
  ListedPictures pictures(folder);
  TransformsFile result;
  std::map<std::string, std::string> file_of;  // by the name in the file
  std::set<std::string> seen;
  for (const JsonValue& frame : frames->AsArray()) {
    const std::string name = NameIn(path, frame, "file_path");
    if (name.empty()) Refuse(path, frame, "a frame has no file_path");
    const JsonValue& at = *frame.Find("file_path");
    const std::string file = pictures.Find(name, PlaceIn(path, at));
    file_of[name] = file;
    if (file.empty()) {
      if (result.missing.empty()) result.nearest = pictures.Nearest(name);
      result.missing.push_back(name);
      continue;
    }
    if (!seen.insert(file).second) Refuse(path, at, "\"" + name + "\" is listed twice");
    CountRenamed(name, file, &result);
    result.frames.push_back(
        {file, ReadCamera(path, top, frame, (folder / file).string(), size_of)});
    if (const std::string mask = NameIn(path, frame, "mask_path"); !mask.empty()) {
      result.frames.back().mask = pictures.Find(mask, PlaceIn(path, *frame.Find("mask_path")));
      if (result.frames.back().mask.empty()) result.missing_masks.push_back(mask);
    }
    if (const std::string depth = NameIn(path, frame, "depth_file_path"); !depth.empty()) {
      result.frames.back().depth =
          pictures.Find(depth, PlaceIn(path, *frame.Find("depth_file_path")));
      if (result.frames.back().depth.empty()) result.missing_depths.push_back(depth);
    }
  }
  if (const JsonValue* unit = top.Find("depth_unit_scale_factor"); unit != nullptr) {
    result.depth_unit = unit->IsNumber() ? unit->AsDouble() : 0;
    if (!(result.depth_unit > 0 && std::isfinite(result.depth_unit)))
      Refuse(path, *unit, "depth_unit_scale_factor is not a positive number");
  }
  const TransformsSplit split = ReadTransformsSplit(path, top, file_of);
  for (const TransformsFrame& frame : result.frames)
    if (split.test.contains(frame.file))
      result.test.insert(frame.file);
    else if (split.IsLeft(frame.file))
      result.left.insert(frame.file);
  if (result.frames.empty() && !may_be_empty)
    throw InputError(
        Concat("none of the ", result.missing.size(), " listed pictures is there",
               (result.missing.empty() ? "" : ", e.g. \"" + result.missing[0] + "\""),
               (result.nearest.empty() ? "" : "; nearest to it is \"" + result.nearest + "\"")),
        path, "file paths are relative to the folder of transforms.json");
  return result;
}

void WriteTransformsJson(const std::string& path, const std::vector<TransformsFrame>& frames) {
  std::vector<JsonValue::Object> intrinsics;
  for (const TransformsFrame& frame : frames)
    intrinsics.push_back(Intrinsics(path, frame.camera));
  bool shared = true;
  for (const JsonValue::Object& object : intrinsics) shared = shared && object == intrinsics[0];

  JsonValue::Object top;
  if (shared && !frames.empty()) top = intrinsics[0];
  JsonValue::Array list;
  for (size_t i = 0; i < frames.size(); ++i) {
    const RigidTransform world_from_camera = frames[i].camera.camera_from_world.Inverse();
    const Mat3d& r = world_from_camera.rotation;
    const Vec3d& t = world_from_camera.translation;
    JsonValue::Array matrix;
    for (int a = 0; a < 3; ++a)
      matrix.push_back(JsonValue::Array{r(a, 0), -r(a, 1), -r(a, 2), t[a]});
    matrix.push_back(JsonValue::Array{0.0, 0.0, 0.0, 1.0});
    JsonValue::Object frame = {{"file_path", frames[i].file}, {"transform_matrix", matrix}};
    if (!shared) frame.insert(frame.end(), intrinsics[i].begin(), intrinsics[i].end());
    list.push_back(std::move(frame));
  }
  top.emplace_back("frames", std::move(list));
  WriteJsonFile(path, std::move(top));
}

}  // namespace regrade
