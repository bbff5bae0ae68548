// The pictures that a style is trained on, one a view, and the scene-wide colour map from the
// photos to them.
#pragma once

#include <string>
#include <vector>

#include "kernels/image/color_statistics.h"
#include "stylize/training/train_network.h"

namespace regrade {

class TrainingTargets {
 public:
  // Of `view`, only target and mask are set here. photo, target: [H, W, 3] sRGB; mask:
  // [H, W, 1], or empty for all pixels: those below 0.5 are left out of training and map.
  void Add(StyledTrainingView view, const Image& photo, Image target, Image mask = {});

  bool empty() const { return views_.empty(); }
  // Valid until the next Add.
  std::vector<StyledTrainingView> views() const;

  // The Monge-Kantorovich map between the pooled colours; notices say where it was limited.
  // There must be a view.
  SceneColorMap SceneMap(std::vector<std::string>* notices) const;

 private:
  std::vector<StyledTrainingView> views_;
  std::vector<Image> targets_, masks_;  // [views]; a mask may be empty
  std::vector<ColorStatistics> before_, after_;
};

// Limits a view to the rectangle around its mask's pixels above 0.5; false if there is none.
bool CropToMask(const Image& mask, StyledTrainingView* view);

}  // namespace regrade
