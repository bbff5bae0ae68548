// Training targets of a style, from photos, what a 2D method made of them, and masks.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "pipeline/fields/field_file.h"
#include "pipeline/stages/object_edit.h"
#include "stylize/training/training_targets.h"

namespace regrade {

// Pictures of one view, all of the size of its camera.
struct StyleView {
  int index = 0;  // in the capture
  Camera camera;
  std::string name;               // for messages
  Image kept;                     // see ReadWorkingMask; empty: all pixels
  std::function<Image()> photo;   // [H, W, 3]
  std::function<Image()> target;  // [H, W, 3]: what the 2D method made of the photo
};

// Without what `kept` masks. With `object`, targets cover pixels inside both the view's mask
// and the consensus mask, which `weights` render. Views without such a pixel are skipped,
// before their pictures are read; none may be left.
class StyleTargets {
 public:
  StyleTargets(const RadianceField& field, const ObjectMasks* object,
               const ObjectWeights* weights);

  bool Add(const StyleView& view);  // false: skipped
  const TrainingTargets& targets() const { return targets_; }

 private:
  const ObjectMasks* object_;
  std::optional<CoverageRenderer> consensus_;
  TrainingTargets targets_;
};

}  // namespace regrade
