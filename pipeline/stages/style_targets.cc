#include "pipeline/stages/style_targets.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "kernels/image/color_statistics.h"
#include "pipeline/capture/photo_gains.h"
#include "pipeline/capture/working_views.h"
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

Lessons ReadLessons(RunContext* context, const Capture& capture, const StoredField& stored,
                    const std::vector<int>& indices, const ObjectMasks* object,
                    const ObjectShares* shares) {
  const RunSettings& settings = context->settings;
  Lessons lessons;
  lessons.targets.reserve(indices.size());  // they are pointed to
  lessons.masks.reserve(indices.size());
  std::optional<CoverageRenderer> agreed;
  if (object != nullptr) agreed.emplace(stored.field, *shares);
  const PhotoGains gains = RecordedGains(*context->workspace, capture);
  std::vector<ColorStatistics> before, after;
  for (const int i : indices) {
    const CaptureView& view = capture.views[static_cast<size_t>(i)];
    StyledTrainingView lesson;
    lesson.camera = WorkingCamera(view.camera, settings.scene.photo_size,
                                  stored.field_from_world, stored.ndc);
    lesson.name = "views_2d/" + FrameName(i);
    Image kept = ReadWorkingMask(view, settings.scene.photo_size);
    if (object != nullptr) {
      Image mask = AgreedMask(object->Coverage(i, lesson.camera.width, lesson.camera.height),
                              agreed->Render(lesson.camera));
      for (int64_t p = 0; p < kept.num_pixels(); ++p) mask.pixels[p] *= kept.pixels[p];
      if (!PartOfMask(mask, &lesson)) continue;
      lessons.masks.push_back(std::move(mask));
      lesson.mask = &lessons.masks.back();
    } else if (kept.num_pixels() > 0) {
      if (std::find(kept.pixels.begin(), kept.pixels.end(), 1.0f) == kept.pixels.end())
        continue;
      lessons.masks.push_back(std::move(kept));
      lesson.mask = &lessons.masks.back();
    }
    lessons.targets.push_back(ReadImage(context->workspace->Path(lesson.name)));
    lesson.target = &lessons.targets.back();
    before.push_back(MeasureColor(
        ReadWorkingPhoto(view, settings.scene.photo_size, gains.Of(i)), lesson.mask));
    after.push_back(MeasureColor(lessons.targets.back(), lesson.mask));
    lessons.views.push_back(std::move(lesson));
  }
  if (lessons.views.empty()) return lessons;
  const MklMap mkl = ComputeMkl(Pool(before), Pool(after));
  for (const std::string& notice : mkl.notices) context->console->Info(notice);
  lessons.notices = mkl.notices;
  lessons.scene_map = {mkl.map, mkl.norm};
  return lessons;
}

}  // namespace regrade
