#include "pipeline/fields/object_file.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "pipeline/files/npz_file.h"

namespace regrade {
namespace {

constexpr int32_t kObjectVersion = 2;

}  // namespace

std::vector<float> SumOfRegions(const std::vector<std::vector<float>>& regions) {
  std::vector<float> sum(regions[0].size());
  for (size_t v = 0; v < sum.size(); ++v) {
    for (const std::vector<float>& region : regions) sum[v] += region[v];
    sum[v] = std::min(sum[v], 1.0f);
  }
  return sum;
}

void WriteObjectFile(const std::string& path, const ObjectWeights& weights) {
  std::vector<float> values;
  for (const std::vector<float>& region : weights.regions)
    values.insert(values.end(), region.begin(), region.end());
  NpzWriter file;
  file.Add("weights", {std::ssize(weights.regions), std::ssize(weights.all)}, values.data(),
           NpzPacking::kDeflate);
  file.AddScalar<int32_t>("regrade_version", kObjectVersion);
  file.WriteTo(path);
}

ObjectWeights ReadObjectFile(const std::string& path, const KeptRecords& records) {
  const int64_t voxels = records.of;
  NpzReader file(path, uint64_t{16} << 30);
  RefuseNewerFormat(&file, kObjectVersion);
  const NpzArray array = file.Read("weights", ArrayType::kF32, {-1, voxels});
  const int64_t regions = array.shape[0];
  if (regions < 1 || regions > kMostObjectRegions)
    throw InputError(Concat("holds ", regions, " regions"), path, "run regrade stylize again");
  ObjectWeights weights;
  for (int64_t k = 0; k < regions; ++k) {
    const float* first = array.As<float>() + k * voxels;
    weights.regions.push_back(records.Pick(std::vector<float>(first, first + voxels)));
  }
  for (const std::vector<float>& region : weights.regions)
    if (!std::ranges::all_of(region, [](float e) { return e >= 0 && e <= 1; }))
      throw InputError("holds a weight outside [0, 1]", path, "run regrade stylize again");
  weights.all = SumOfRegions(weights.regions);
  return weights;
}

}  // namespace regrade
