// What the style's network learns from: views, what the 2D method made of them, and the colour
// map between the two.
#pragma once

#include <vector>

#include "pipeline/fields/field_file.h"
#include "pipeline/run/run_context.h"
#include "pipeline/stages/object_edit.h"
#include "stylize/training/train_network.h"

namespace regrade {

struct StyleTargets {
  std::vector<Image> targets, masks;  // that `views` point to
  std::vector<StyledTrainingView> views;
  SceneColorMap scene_map;
  std::vector<std::string> notices;  // of the map
};

// Of the views `indices` (see StyledViews), without what --photo-masks masks. With `object`,
// the lessons are of the pixels where a view's own mask and what all masks agreed on both say
// that the object is seen, and views without such a pixel are left out; there may be none left.
StyleTargets ReadStyleTargets(RunContext* context, const WorkingViews& views,
                              const StoredField& stored, const std::vector<int>& indices,
                              const ObjectMasks* object, const ObjectWeights* shares);

}  // namespace regrade
