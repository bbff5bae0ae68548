#include "pipeline/stages/style_targets.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "kernels/image/color_statistics.h"
#include "pipeline/images/image_file.h"
#include "pipeline/workspace/output_names.h"
#include "stylize/image/monge_kantorovich.h"

namespace regrade {
namespace {

Image AgreedMask(const std::vector<Image>& given, const std::vector<Image>& agreed) {
  Image mask(given[0].width, given[0].height, 1);
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    float one = 0, all = 0;
    for (const Image& region : given) one += region.pixels[i];
    for (const Image& region : agreed) all += region.pixels[i];
    mask.pixels[i] = std::min(one, all);
  }
  return mask;
}

// The rectangle around the mask; false if it is empty.
bool PartOfMask(const Image& mask, StyledTrainingView* view) {
  view->x0 = mask.width, view->y0 = mask.height, view->x1 = view->y1 = 0;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      if (!(*mask.at(x, y) > 0.5f)) continue;
      view->x0 = std::min(view->x0, x), view->x1 = std::max(view->x1, x + 1);
      view->y0 = std::min(view->y0, y), view->y1 = std::max(view->y1, y + 1);
    }
  return view->x1 > view->x0;
}

}  // namespace

StyleTargets ReadStyleTargets(RunContext* context, const WorkingViews& views,
                              const StoredField& stored, const std::vector<int>& indices,
                              const ObjectMasks* object, const ObjectWeights* shares) {
  StyleTargets style_targets;
  style_targets.targets.reserve(indices.size());  // they are pointed to
  style_targets.masks.reserve(indices.size());
  std::optional<CoverageRenderer> agreed;
  if (object != nullptr) agreed.emplace(stored.field, *shares);
  std::vector<ColorStatistics> before, after;
  for (const int i : indices) {
    StyledTrainingView target;
    target.camera = views.CameraOf(i);
    target.name = "views_2d/" + FrameName(i);
    Image kept = views.Mask(i);
    if (object != nullptr) {
      Image mask = AgreedMask(object->Coverage(i, target.camera.width, target.camera.height),
                              agreed->Render(target.camera));
      for (int64_t p = 0; p < kept.num_pixels(); ++p) mask.pixels[p] *= kept.pixels[p];
      if (!PartOfMask(mask, &target)) continue;
      style_targets.masks.push_back(std::move(mask));
      target.mask = &style_targets.masks.back();
    } else if (kept.num_pixels() > 0) {
      if (std::find(kept.pixels.begin(), kept.pixels.end(), 1.0f) == kept.pixels.end())
        continue;
      style_targets.masks.push_back(std::move(kept));
      target.mask = &style_targets.masks.back();
    }
    style_targets.targets.push_back(ReadImage(context->workspace->Path(target.name)));
    target.target = &style_targets.targets.back();
    before.push_back(MeasureColor(views.Photo(i), target.mask));
    after.push_back(MeasureColor(style_targets.targets.back(), target.mask));
    style_targets.views.push_back(std::move(target));
  }
  if (style_targets.views.empty()) return style_targets;
  const MklMap mkl = ComputeMkl(Pool(before), Pool(after));
  for (const std::string& notice : mkl.notices) context->console->Info(notice);
  style_targets.notices = mkl.notices;
  style_targets.scene_map = {mkl.map, mkl.norm};
  return style_targets;
}

}  // namespace regrade
