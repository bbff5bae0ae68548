#include "pipeline/stages/style_targets.h"

#include <algorithm>
#include <utility>

namespace regrade {
namespace {

Image ConsensusMask(const std::vector<Image>& given, const std::vector<Image>& consensus) {
  Image mask(given[0].width, given[0].height, 1);
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    float one = 0, all = 0;
    for (const Image& region : given) one += region.pixels[i];
    for (const Image& region : consensus) all += region.pixels[i];
    mask.pixels[i] = std::min(one, all);
  }
  return mask;
}

}  // namespace

StyleTargets::StyleTargets(const RadianceField& field, const ObjectMasks* object,
                           const ObjectWeights* weights)
    : object_(object) {
  if (object != nullptr) consensus_.emplace(field, *weights);
}

bool StyleTargets::Add(const StyleView& view) {
  StyledTrainingView training_view;
  training_view.camera = view.camera;
  training_view.name = view.name;
  Image mask = view.kept;
  if (object_ != nullptr) {
    mask = ConsensusMask(object_->Coverage(view.index, view.camera.width, view.camera.height),
                         consensus_->Render(view.camera));
    for (int64_t p = 0; p < view.kept.num_pixels(); ++p) mask.pixels[p] *= view.kept.pixels[p];
    if (!CropToMask(mask, &training_view)) return false;
  } else if (!mask.empty() && std::ranges::find(mask.pixels, 1.0f) == mask.pixels.end()) {
    return false;
  }
  targets_.Add(std::move(training_view), view.photo(), view.target(), std::move(mask));
  return true;
}

}  // namespace regrade
