#include "pipeline/stages/object_edit.h"

#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/field/cpu/render_view.h"
#include "pipeline/files/npz_file.h"
#include "stylize/field/object_weights.h"

namespace regrade {
namespace {

// A render's rounding of what is exactly 0.
constexpr float kNothing = 1.0f / 1024;

std::vector<float> SumOf(const std::vector<std::vector<float>>& regions) {
  std::vector<float> sum(regions[0].size());
  for (size_t v = 0; v < sum.size(); ++v) {
    for (const std::vector<float>& region : regions) sum[v] += region[v];
    sum[v] = std::min(sum[v], 1.0f);
  }
  return sum;
}

}  // namespace

std::unique_ptr<ObjectMasks> OpenObjectMasks(const RunSettings& settings,
                                             const Capture& capture) {
  if (!settings.object.On()) return nullptr;
  std::vector<std::string> photos;
  for (const CaptureView& view : capture.views) photos.push_back(view.file);
  return std::make_unique<ObjectMasks>(settings.object, photos);
}

ObjectWeights VoteForObject(const RunSettings& settings, const WorkingViews& working_views,
                            const std::vector<int>& views, const ObjectMasks& masks,
                            const RadianceField& field, const ProgressFunction& progress) {
  std::vector<MaskVote> votes;
  for (int k = 0; k < masks.num_regions(); ++k)
    votes.emplace_back(*field.geometry, field.near_clip, MarchOptions{field.step});
  for (size_t n = 0; n < views.size(); ++n) {
    ReportOrThrow(progress, n, views.size(), "masks vote");
    const int i = views[n];
    if (!masks.Knows(i)) continue;
    const Camera camera = working_views.CameraOf(i);
    const std::vector<Image> coverage = masks.Coverage(i, camera.width, camera.height);
    for (size_t k = 0; k < votes.size(); ++k) votes[k].Add(camera, coverage[k]);
  }
  ObjectWeights weights;
  for (const MaskVote& vote : votes)
    weights.regions.push_back(vote.Weights(settings.object.vote, settings.object.edge));
  weights.all = SumOf(weights.regions);
  return weights;
}

void WriteObjectFile(const std::string& path, const ObjectWeights& weights) {
  std::vector<float> values;
  for (const std::vector<float>& region : weights.regions)
    values.insert(values.end(), region.begin(), region.end());
  NpzWriter file;
  file.Add("weights", {std::ssize(weights.regions), std::ssize(weights.all)}, values.data(),
           NpzPacking::kDeflate);
  file.AddScalar<int32_t>("regrade_version", 2);
  file.WriteTo(path);
}

ObjectWeights ReadObjectFile(const std::string& path, int64_t voxels) {
  NpzReader file(path, uint64_t{16} << 30);
  RefuseNewerFormat(&file, 2);
  const NpzArray array = file.Read("weights", ArrayType::kF32, {-1, voxels});
  const int64_t regions = array.shape[0];
  if (regions < 1 || regions > ObjectMasks::kMostRegions)
    throw InputError(Concat("holds ", regions, " regions"), path, "run regrade stylize again");
  ObjectWeights weights;
  for (int64_t k = 0; k < regions; ++k) {
    const float* first = array.As<float>() + k * voxels;
    weights.regions.emplace_back(first, first + voxels);
  }
  for (const std::vector<float>& region : weights.regions)
    if (!std::ranges::all_of(region, [](float e) { return e >= 0 && e <= 1; }))
      throw InputError("holds a weight outside [0, 1]", path, "run regrade stylize again");
  weights.all = SumOf(weights.regions);
  return weights;
}

CoverageRenderer::CoverageRenderer(const RadianceField& field, const ObjectWeights& weights)
    : step_(field.step) {
  for (const std::vector<float>& region : weights.regions)
    grids_.push_back(MakeFastGrid(WeightField(field, region)));
}

std::vector<Image> CoverageRenderer::Render(const Camera& camera) const {
  std::vector<Image> coverage;
  for (const FastGrid& grid : grids_) {
    const Image color = RenderView(grid, camera, MarchOptions{step_}).color;
    Image region(color.width, color.height, 1);
    for (int64_t i = 0; i < region.num_pixels(); ++i) {
      const float m = color.pixels[3 * i];
      region.pixels[i] = m > kNothing ? m : 0;
    }
    coverage.push_back(std::move(region));
  }
  return coverage;
}

}  // namespace regrade
