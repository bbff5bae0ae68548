// Styles of an object alone: object weights of voxels from masks of photos, and masks rendered
// from them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/render/field_renderer.h"
#include "kernels/scene/capture.h"
#include "pipeline/capture/object_masks.h"
#include "pipeline/fields/object_file.h"
#include "pipeline/run/run_context.h"

namespace regrade {

// The masks that --masks names, as the views see them; null where the whole scene is styled.
std::unique_ptr<ObjectMasks> OpenObjectMasks(const RunSettings& settings,
                                             const WorkingViews& views);

// See EQ(mask-vote); the masks of `views` vote.
ObjectWeights VoteForObject(const RunSettings& settings, const WorkingViews& working_views,
                            const std::vector<int>& views, const ObjectMasks& masks,
                            const RadianceField& field, const ProgressFunction& progress);

// The share of each pixel that is not the background's, as of one region.
Image CoverageOf(Image transmittance);

// Renders the consensus masks from any camera: how much of each pixel belongs to each region.
class CoverageRenderer {
 public:
  CoverageRenderer(const RadianceField& field, const ObjectWeights& weights);
  std::vector<Image> Render(const Camera& camera) const;

 private:
  float step_;
  std::vector<FieldRenderer> renderers_;
};

}  // namespace regrade
