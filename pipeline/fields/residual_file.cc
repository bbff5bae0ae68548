#include "pipeline/fields/residual_file.h"

#include <cmath>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr int32_t kResidualVersion = 1;
constexpr float kNothing = 0.25f / 255;
constexpr float kLargest = 64;  // no colour is further than a few units from another

std::vector<Vec3f> ReadColors(NpzReader* file, const std::string& name, int64_t voxels,
                              float least, float most, const std::string& path) {
  const NpzArray array = file->Read(name, ArrayType::kF32, {voxels, 3});
  const float* values = array.As<float>();
  std::vector<Vec3f> colors(static_cast<size_t>(voxels));
  for (size_t v = 0; v < colors.size(); ++v)
    for (int c = 0; c < 3; ++c) {
      colors[v][c] = values[3 * v + static_cast<size_t>(c)];
      if (!(colors[v][c] >= least && colors[v][c] <= most))
        throw InputError("holds a value in " + name + " that is none", path,
                         "run regrade stylize again");
    }
  return colors;
}

}  // namespace

void WriteResidualFile(const std::string& path, const VoxelResidual& residual) {
  std::vector<float> values, scales;
  for (const Vec3f& x : residual.color)
    for (int c = 0; c < 3; ++c) values.push_back(std::abs(x[c]) < kNothing ? 0.0f : x[c]);
  for (const Vec3f& x : residual.view_scale)
    for (int c = 0; c < 3; ++c) scales.push_back(x[c]);
  const int64_t voxels = std::ssize(residual.color);
  NpzWriter file;
  file.Add("residual", {voxels, 3}, values.data(), NpzPacking::kDeflate);
  if (!scales.empty()) file.Add("view_scale", {voxels, 3}, scales.data(), NpzPacking::kDeflate);
  file.AddScalar<int32_t>("regrade_version", kResidualVersion);
  file.WriteTo(path);
}

VoxelResidual ReadResidualFile(const std::string& path, const KeptRecords& records) {
  const int64_t voxels = records.of;
  NpzReader file(path, uint64_t{16} << 30);
  RefuseNewerFormat(&file, kResidualVersion);
  VoxelResidual residual;
  residual.color =
      records.Pick(ReadColors(&file, "residual", voxels, -kLargest, kLargest, path));
  if (file.Has("view_scale"))
    residual.view_scale = records.Pick(ReadColors(&file, "view_scale", voxels, 0, 1, path));
  return residual;
}

}  // namespace regrade
