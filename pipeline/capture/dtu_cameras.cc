#include "pipeline/capture/dtu_cameras.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "kernels/base/error.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr uint64_t kMostDtuBytes = 16 << 20;
constexpr double kMostSkew = 1e-3;      // of the focal length
constexpr double kLeastPivot = 1e-9;    // of the largest element: below, a matrix is singular
constexpr int kMostNumber = 1'000'000;  // of a picture
constexpr char kWorld[] = "world_mat_", kScale[] = "scale_mat_";

// The number behind the prefix, if the name is nothing else.
std::optional<int> NumberOf(const std::string& name, const std::string& prefix) {
  if (!name.starts_with(prefix)) return std::nullopt;
  int number = 0;
  const char* const end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data() + prefix.size(), end, number);
  if (error != std::errc() || stop != end || number < 0 || number > kMostNumber)
    return std::nullopt;
  return number;
}

// [4, 4]; a matrix of three rows gets 0 0 0 1.
std::vector<double> ReadMatrix(NpzReader* file, const std::string& name) {
  const NpzArray array = file->Read(name);
  const bool three = array.shape == std::vector<int64_t>{3, 4};
  const bool real = array.type == ArrayType::kF32 || array.type == ArrayType::kF64;
  if (!real || (!three && array.shape != std::vector<int64_t>{4, 4}))
    throw InputError("is not a matrix of 4 x 4 real numbers", file->path() + ", " + name);
  std::vector<double> matrix{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1};
  for (int64_t i = 0; i < array.num_elements(); ++i) {
    double& value = matrix[static_cast<size_t>(i)];
    value = array.type == ArrayType::kF32 ? static_cast<double>(array.As<float>()[i])
                                          : array.As<double>()[i];
    if (!std::isfinite(value))
      throw InputError("has a value that is not finite", file->path() + ", " + name);
  }
  return matrix;
}

}  // namespace

Camera CameraOfProjection(const double* projection, const std::string& where) {
  Vec3d m[3], p{projection[3], projection[7], projection[11]};
  double largest = 0;
  for (int i = 0; i < 3; ++i) {
    m[i] = {projection[4 * i], projection[4 * i + 1], projection[4 * i + 2]};
    for (int a = 0; a < 3; ++a) largest = std::max(largest, std::abs(m[i][a]));
  }
  if (!(largest > 0) || !std::isfinite(largest))
    throw InputError("is no projection", where, "the file is damaged");
  // Known up to a factor: elements of at most 1, and a rotation that keeps its handedness.
  const double factor = (Dot(m[0], Cross(m[1], m[2])) < 0 ? -1 : 1) / largest;
  for (Vec3d& row : m) row = row * factor;
  p = p * factor;
  // m = K R, K upper triangular with a positive diagonal: rows from the last to the first.
  double k[3][3] = {};
  Mat3d rotation;
  for (int i = 2; i >= 0; --i) {
    Vec3d rest = m[i];
    for (int j = 2; j > i; --j) {
      k[i][j] = Dot(m[i], rotation.row[j]);
      rest = rest - rotation.row[j] * k[i][j];
    }
    k[i][i] = Norm(rest);
    if (!(k[i][i] > kLeastPivot * k[2][2]) || !(k[i][i] > 0))
      throw InputError("is no projection", where, "the file is damaged");
    rotation.row[i] = rest * (1 / k[i][i]);
  }
  if (!(std::abs(k[0][1]) <= kMostSkew * k[0][0]))
    throw InputError("its pixels are skewed", where, "undistort the pictures first");
  Camera camera;
  camera.fx = k[0][0] / k[2][2];
  camera.fy = k[1][1] / k[2][2];
  camera.cx = k[0][2] / k[2][2];
  camera.cy = k[1][2] / k[2][2];
  camera.camera_from_world.rotation = rotation;
  Vec3d& t = camera.camera_from_world.translation;  // K t = p
  for (int i = 2; i >= 0; --i) {
    double rest = p[i];
    for (int j = 2; j > i; --j) rest -= k[i][j] * t[j];
    t[i] = rest / k[i][i];
  }
  if (!std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy + Norm(t)))
    throw InputError("is no projection", where, "the file is damaged");
  return camera;
}

std::map<int, Camera> ReadDtuCameras(const std::string& path) {
  NpzReader file(path, kMostDtuBytes);
  const std::vector<std::string> names = file.names();
  std::vector<int> numbers;
  bool scaled = true;
  for (const std::string& name : names)
    if (const std::optional<int> number = NumberOf(name, kWorld)) {
      numbers.push_back(*number);
      scaled = scaled && file.Has(kScale + std::to_string(*number));
    }
  if (numbers.empty())
    throw InputError("holds no world_mat_0", path, "DTU's cameras.npz as IDR has it is read");
  std::map<int, Camera> cameras;
  for (const int number : numbers) {
    const std::string name = kWorld + std::to_string(number);
    const std::vector<double> world = ReadMatrix(&file, name);
    std::vector<double> projection(world.begin(), world.begin() + 12);
    if (scaled) {
      const std::vector<double> scale = ReadMatrix(&file, kScale + std::to_string(number));
      for (size_t i = 0; i < 3; ++i)
        for (size_t j = 0; j < 4; ++j) {
          projection[4 * i + j] = 0;
          for (size_t a = 0; a < 4; ++a)
            projection[4 * i + j] += world[4 * i + a] * scale[4 * a + j];
        }
    }
    cameras[number] = CameraOfProjection(projection.data(), path + ", " + name);
  }
  return cameras;
}

}  // namespace regrade
