#include "stylize/training/training_targets.h"

#include <algorithm>

#include "stylize/image/monge_kantorovich.h"

namespace regrade {

void TrainingTargets::Add(StyledTrainingView view, const Image& photo, Image target,
                          Image mask) {
  const Image* kept = mask.empty() ? nullptr : &mask;
  before_.push_back(MeasureColor(photo, kept));
  after_.push_back(MeasureColor(target, kept));
  views_.push_back(std::move(view));
  targets_.push_back(std::move(target));
  masks_.push_back(std::move(mask));
}

std::vector<StyledTrainingView> TrainingTargets::views() const {
  std::vector<StyledTrainingView> views = views_;
  for (size_t i = 0; i < views.size(); ++i) {
    views[i].target = &targets_[i];
    views[i].mask = masks_[i].empty() ? nullptr : &masks_[i];
  }
  return views;
}

SceneColorMap TrainingTargets::SceneMap(std::vector<std::string>* notices) const {
  const MklMap mkl = ComputeMkl(Pool(before_), Pool(after_));
  *notices = mkl.notices;
  return {mkl.map, mkl.norm};
}

bool CropToMask(const Image& mask, StyledTrainingView* view) {
  view->x0 = mask.width, view->y0 = mask.height, view->x1 = view->y1 = 0;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      if (!(*mask.at(x, y) > 0.5f)) continue;
      view->x0 = std::min(view->x0, x), view->x1 = std::max(view->x1, x + 1);
      view->y0 = std::min(view->y0, y), view->y1 = std::max(view->y1, y + 1);
    }
  return view->x1 > view->x0;
}

}  // namespace regrade
