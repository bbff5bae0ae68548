#include "pipeline/stages/object_edit.h"

#include "kernels/base/error.h"
#include "stylize/field/object_weights.h"

namespace regrade {
namespace {

// A render's rounding of what is exactly 0.
constexpr float kNothing = 1.0f / 1024;

static_assert(ObjectMasks::kMostRegions == kMostObjectRegions);

}  // namespace

std::unique_ptr<ObjectMasks> OpenObjectMasks(const RunSettings& settings,
                                             const WorkingViews& views) {
  if (!settings.object.On()) return nullptr;
  return std::make_unique<ObjectMasks>(settings.object, FilesOf(views.capture()), views);
}

ObjectWeights VoteForObject(const RunSettings& settings, const WorkingViews& working_views,
                            const std::vector<int>& views, const ObjectMasks& masks,
                            const RadianceField& field, const ProgressFunction& progress) {
  std::vector<MaskVote> votes;
  for (int k = 0; k < masks.num_regions(); ++k)
    votes.emplace_back(*field.geometry, field.near_clip, field.march);
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
  weights.all = SumOfRegions(weights.regions);
  return weights;
}

Image CoverageOf(Image transmittance) {
  for (float& value : transmittance.pixels) value = value < 1 - kNothing ? 1 - value : 0;
  return transmittance;
}

CoverageRenderer::CoverageRenderer(const RadianceField& field, const ObjectWeights& weights) {
  for (const std::vector<float>& region : weights.regions)
    renderers_.emplace_back(WeightField(field, region), Backend::kCpu);
}

std::vector<Image> CoverageRenderer::Render(const Camera& camera) const {
  std::vector<Image> coverage;
  for (const FieldRenderer& renderer : renderers_) {
    const Image color = renderer.Render(camera).color;
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
