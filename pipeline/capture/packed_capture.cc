#include "pipeline/capture/packed_capture.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr int32_t kVersion = 1;
constexpr int64_t kCameraValues = 27;  // see PackCamera
constexpr uint64_t kBudget = uint64_t{16} << 30;
constexpr int64_t kMaxPackedSide = 1 << 14;
constexpr int kMaxVertices = 4096;  // along an axis, as in field files

// width, height, fx, fy, cx, cy, lens, distortion [8], rotation [9] by rows, translation [3].
void PackCamera(const Camera& camera, double* v) {
  const double head[] = {static_cast<double>(camera.width),
                         static_cast<double>(camera.height),
                         camera.fx,
                         camera.fy,
                         camera.cx,
                         camera.cy,
                         static_cast<double>(camera.lens)};
  v = std::copy(std::begin(head), std::end(head), v);
  v = std::copy(camera.distortion.begin(), camera.distortion.end(), v);
  for (int i = 0; i < 9; ++i) *v++ = camera.camera_from_world.rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) *v++ = camera.camera_from_world.translation[i];
}

Camera UnpackCamera(const double* v, const std::string& where) {
  if (!std::all_of(v, v + kCameraValues, [](double x) { return std::isfinite(x); }) ||
      !(v[0] >= 1 && v[0] <= kMaxPackedSide && v[1] >= 1 && v[1] <= kMaxPackedSide &&
        v[2] > 0 && v[3] > 0 && v[6] >= 0 && v[6] <= static_cast<double>(LensModel::kFisheye)))
    throw InputError("a camera is out of range", where, "pack the capture again");
  Camera camera;
  camera.width = static_cast<int>(v[0]);
  camera.height = static_cast<int>(v[1]);
  camera.fx = v[2], camera.fy = v[3], camera.cx = v[4], camera.cy = v[5];
  camera.lens = static_cast<LensModel>(static_cast<int>(v[6]));
  std::copy_n(v + 7, 8, camera.distortion.begin());
  for (int i = 0; i < 9; ++i) camera.camera_from_world.rotation(i / 3, i % 3) = v[15 + i];
  for (int i = 0; i < 3; ++i) camera.camera_from_world.translation[i] = v[24 + i];
  const RigidTransform& pose = camera.camera_from_world;
  if (!ImplausibleCamera(camera).empty() || !IsSound({1, pose.rotation, pose.translation}))
    throw InputError("a camera is implausible", where, "pack the capture again");
  return camera;
}

void PackPixels(const Image& photo, uint8_t* to) {
  for (int y = 0; y < photo.height; ++y) {
    uint8_t left[3] = {};
    for (int x = 0; x < photo.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const float value = std::clamp(photo.at(x, y)[c], 0.0f, 1.0f);
        const auto level = static_cast<uint8_t>(std::lround(value * 255.0f));
        *to++ = static_cast<uint8_t>(level - left[c]);
        left[c] = level;
      }
  }
}

Image UnpackPixels(const uint8_t* from, int width, int height) {
  Image photo(width, height, 3);
  for (int y = 0; y < height; ++y) {
    uint8_t left[3] = {};
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        left[c] = static_cast<uint8_t>(left[c] + *from++);
        photo.at(x, y)[c] = static_cast<float>(left[c]) / 255.0f;
      }
  }
  return photo;
}

// Throws for a frame or box that a fit cannot use.
void CheckScene(const NormalizedScene& scene, const std::string& path) {
  const SceneBox& box = scene.box;
  bool sound = IsSound(scene.field_from_world) && std::isfinite(box.near_clip) &&
               box.near_clip >= 0 && box.layers >= 0 && box.layers <= kMaxVertices;
  for (int i = 0; i < 3; ++i)
    sound = sound && std::isfinite(box.center[i]) && std::isfinite(box.radius[i]) &&
            box.radius[i] > 0 && (!box.background || std::isfinite((*box.background)[i]));
  for (const double side : {scene.ndc.a, scene.ndc.b})
    sound = sound && side >= 0 && side < 1e3 && (side > 0) == (scene.ndc.a > 0);
  if (!sound)
    throw InputError("its box or frame is not that of a capture", path,
                     "pack the capture again");
}

// Leaves views without points where the file has none.
void ReadPoints(NpzReader* file, const std::string& path, std::vector<PackedView>* views) {
  if (!file->Has("points")) return;
  const NpzArray counts = file->Read("points_of_view", ArrayType::kI32, {std::ssize(*views)});
  const NpzArray points = file->Read("points", ArrayType::kF32, {-1, 4});
  const float* at = points.As<float>();
  int64_t left = points.shape[0];
  for (size_t v = 0; v < views->size(); ++v) {
    const int32_t count = counts.As<int32_t>()[v];
    if (count < 0 || count > left ||
        !std::all_of(at, at + 4 * count, [](float x) { return std::isfinite(x); }))
      throw InputError("holds fewer points than its views have, or one that is not finite",
                       path + ": points", "pack the capture again");
    left -= count;
    for (const float* end = at + 4 * count; at < end; at += 4)
      (*views)[v].points.push_back({{at[0], at[1], at[2]}, at[3]});
  }
}

int64_t BytesOf(const Camera& camera) { return int64_t{camera.width} * camera.height * 3; }

}  // namespace

void WritePackedCapture(const std::string& path, const PackedCapture& capture) {
  const auto n = std::ssize(capture.views);
  std::vector<double> cameras(n * kCameraValues);
  std::vector<uint8_t> held_out;
  std::string names;
  int64_t bytes = 0;
  for (const PackedView& view : capture.views) bytes += BytesOf(view.camera);
  Buffer<uint8_t> pixels(bytes);
  int64_t at = 0;
  for (const PackedView& view : capture.views) {
    PackCamera(view.camera, &cameras[held_out.size() * kCameraValues]);
    PackPixels(view.photo, pixels.data() + at);
    at += BytesOf(view.camera);
    held_out.push_back(view.held_out);
    names += view.file + '\0';
  }
  const SceneBox& box = capture.scene.box;
  const float box_values[] = {box.center.x, box.center.y, box.center.z, box.radius.x,
                              box.radius.y, box.radius.z, box.near_clip};
  const Similarity& similarity = capture.scene.field_from_world;
  double placement[13] = {similarity.scale};
  for (int i = 0; i < 9; ++i) placement[1 + i] = similarity.rotation(i / 3, i % 3);
  for (int i = 0; i < 3; ++i) placement[10 + i] = similarity.translation[i];

  NpzWriter file;
  file.AddScalar<int32_t>("regrade_version", kVersion);
  file.AddText("files", names);
  file.AddText("decided", capture.decided);
  file.Add("cameras", {n, kCameraValues}, cameras.data());
  file.Add("held_out", {n}, held_out.data());
  file.Add("pixels", {bytes}, pixels.data(), NpzPacking::kDeflate);
  file.Add("box", {7}, box_values);
  file.AddScalar<int32_t>("layers", box.layers);
  if (box.far_surroundings) file.AddScalar<int32_t>("spheres", 1);
  if (box.background) file.Add("background", {3}, &box.background->x);
  file.Add("field_from_world", {13}, placement);
  file.Add("ndc", {2}, &capture.scene.ndc.a);
  std::vector<int32_t> points_of_view;
  std::vector<SeenPoint> points;
  for (const PackedView& view : capture.views) {
    points_of_view.push_back(static_cast<int32_t>(view.points.size()));
    points.insert(points.end(), view.points.begin(), view.points.end());
  }
  static_assert(sizeof(SeenPoint) == 4 * sizeof(float));
  file.Add("points_of_view", {n}, points_of_view.data());
  file.Add("points", {std::ssize(points), 4}, reinterpret_cast<const float*>(points.data()),
           NpzPacking::kDeflate);
  Buffer<uint8_t> style(capture.style.num_pixels() * 3);  // the writer reads it when it writes
  if (style.size() > 0) {
    PackPixels(capture.style, style.data());
    file.Add("style", {capture.style.height, capture.style.width, 3}, style.data(),
             NpzPacking::kDeflate);
  }
  file.WriteTo(path);
}

PackedCapture ReadPackedCapture(const std::string& path) {
  NpzReader file(path, kBudget);
  RefuseNewerFormat(&file, kVersion);
  const NpzArray cameras = file.Read("cameras", ArrayType::kF64, {-1, kCameraValues});
  const int64_t n = cameras.shape[0];
  const NpzArray held_out = file.Read("held_out", ArrayType::kU8, {n});
  const NpzArray pixels = file.Read("pixels", ArrayType::kU8, {-1});
  const NpzArray box = file.Read("box", ArrayType::kF32, {7});
  const NpzArray placement = file.Read("field_from_world", ArrayType::kF64, {13});
  const NpzArray ndc = file.Read("ndc", ArrayType::kF64, {2});
  const std::string names = file.ReadText("files");
  PackedCapture capture;
  if (file.Has("decided")) capture.decided = file.ReadText("decided");
  capture.scene.ndc = {ndc.As<double>()[0], ndc.As<double>()[1]};
  const float* b = box.As<float>();
  capture.scene.box.center = {b[0], b[1], b[2]};
  capture.scene.box.radius = {b[3], b[4], b[5]};
  capture.scene.box.near_clip = b[6];
  capture.scene.box.layers = file.ReadScalar<int32_t>("layers");
  capture.scene.box.far_surroundings =
      file.Has("spheres") && file.ReadScalar<int32_t>("spheres") != 0;
  capture.scene.box.voxel_aspect = VoxelAspect(capture.scene.ndc);
  if (file.Has("background")) {
    const NpzArray array = file.Read("background", ArrayType::kF32, {3});
    capture.scene.box.background =
        Vec3f{array.As<float>()[0], array.As<float>()[1], array.As<float>()[2]};
  }
  Similarity& similarity = capture.scene.field_from_world;
  similarity.scale = placement.As<double>()[0];
  for (int i = 0; i < 9; ++i) similarity.rotation(i / 3, i % 3) = placement.As<double>()[1 + i];
  for (int i = 0; i < 3; ++i) similarity.translation[i] = placement.As<double>()[10 + i];

  CheckScene(capture.scene, path);
  if (file.Has("style")) {
    const NpzArray style = file.Read("style", ArrayType::kU8, {-1, -1, 3});
    if (style.shape[0] > kMaxPackedSide || style.shape[1] > kMaxPackedSide)
      throw InputError("is too large", path + ": style", "pack the capture again");
    capture.style = UnpackPixels(style.bytes.data(), static_cast<int>(style.shape[1]),
                                 static_cast<int>(style.shape[0]));
  }

  int64_t at = 0;
  size_t name_begin = 0;
  for (int64_t i = 0; i < n; ++i) {
    PackedView view;
    view.camera = UnpackCamera(cameras.As<double>() + i * kCameraValues, path + ": cameras");
    view.camera.ndc = capture.scene.ndc;
    view.held_out = held_out.bytes[i] != 0;
    const size_t name_end = std::min(names.find('\0', name_begin), names.size());
    view.file = names.substr(name_begin, name_end - name_begin);
    name_begin = std::min(name_end + 1, names.size());
    const int64_t bytes = BytesOf(view.camera);
    if (bytes > pixels.bytes.size() - at)
      throw InputError("holds fewer pixels than its cameras have", path + ": pixels",
                       "pack the capture again");
    view.photo = UnpackPixels(pixels.bytes.data() + at, view.camera.width, view.camera.height);
    at += bytes;
    capture.views.push_back(std::move(view));
  }
  ReadPoints(&file, path, &capture.views);
  return capture;
}

}  // namespace regrade
