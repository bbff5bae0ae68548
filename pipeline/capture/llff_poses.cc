#include "pipeline/capture/llff_poses.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "kernels/base/error.h"
#include "kernels/scene/camera_checks.h"
#include "kernels/scene/facing.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/npy_header.h"

namespace regrade {
namespace {

constexpr int kColumns = 17;
constexpr int kMaxLlffSide = 1 << 16;  // pixels
constexpr uint64_t kMostLlffBytes = 16 << 20;
constexpr double kLlffRigidTolerance = 1e-2;

[[noreturn]] void Refuse(const std::string& path, size_t row, const std::string& what) {
  throw InputError(Concat("pose ", row, ": ", what), path,
                   "the file is damaged, or was written by another program");
}

Camera CameraOf(const std::string& path, size_t row, const double* v) {
  const auto at = [v](int i, int j) { return v[5 * i + j]; };
  Camera camera;
  const double height = at(0, 4), width = at(1, 4), focal = at(2, 4);
  if (!(width >= 1 && width <= kMaxLlffSide && height >= 1 && height <= kMaxLlffSide &&
        focal > 0))
    Refuse(path, row, "its size or focal length is implausible");
  camera.width = static_cast<int>(std::lround(width));
  camera.height = static_cast<int>(std::lround(height));
  camera.fx = camera.fy = focal;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  Vec3d axis[3];  // right, down, forward of the camera in the world
  for (int i = 0; i < 3; ++i) {
    axis[0][i] = at(i, 1);
    axis[1][i] = at(i, 0);
    axis[2][i] = -at(i, 2);
  }
  const double off =
      std::max({std::abs(Norm(axis[0]) - 1), std::abs(Norm(axis[2]) - 1),
                std::abs(Dot(axis[0], axis[2])), Norm(Cross(axis[2], axis[0]) - axis[1])});
  if (!(off < kLlffRigidTolerance)) Refuse(path, row, "the matrix is not a rotation");
  const Vec3d forward = Normalized(axis[2]);
  const Vec3d right = Normalized(axis[0] - forward * Dot(axis[0], forward));
  camera.camera_from_world = Facing(Vec3d{at(0, 3), at(1, 3), at(2, 3)}, forward, right);
  const std::string implausible = ImplausibleCamera(camera);
  if (!implausible.empty()) Refuse(path, row, "the camera has " + implausible);
  return camera;
}

}  // namespace

LlffPoses ReadPosesBounds(const std::string& path) {
  const std::string bytes = ReadWholeFile(path, kMostLlffBytes);
  const NpyHeader header = ParseNpyHeader(bytes, path);
  if (header.type != ArrayType::kF64 || header.shape.size() != 2 ||
      header.shape[1] != kColumns || header.shape[0] < 1 ||
      header.data_bytes != bytes.size() - header.data_offset)
    throw InputError("is not a table of 17 doubles per pose", path,
                     "poses_bounds.npy is written by LLFF's imgs2poses.py");
  std::vector<double> values(header.data_bytes / sizeof(double));
  std::memcpy(values.data(), bytes.data() + header.data_offset, header.data_bytes);
  LlffPoses result;
  result.nearest = 1e300;
  for (size_t row = 0; row < values.size() / kColumns; ++row) {
    const double* v = &values[row * kColumns];
    for (int i = 0; i < kColumns; ++i)
      if (!std::isfinite(v[i])) Refuse(path, row, "a value is not finite");
    if (!(v[15] > 0 && v[16] > v[15])) Refuse(path, row, "bounds are not 0 < near < far");
    result.cameras.push_back(CameraOf(path, row, v));
    result.nearest = std::min(result.nearest, v[15]);
    result.farthest = std::max(result.farthest, v[16]);
  }
  return result;
}

}  // namespace regrade
