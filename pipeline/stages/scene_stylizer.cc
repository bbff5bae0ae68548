#include "pipeline/stages/scene_stylizer.h"

#include "pipeline/files/image_file.h"
#include "pipeline/scene_views.h"

namespace regrade {

std::unique_ptr<ViewStylizer> MakeSceneStylizer(RunContext* context, const Capture& capture) {
  const RunSettings& settings = context->settings;
  std::string notice;
  const Image style = ReadStylePicture(settings.style.picture, &notice);
  if (!notice.empty()) context->console->Info(notice);
  if (!settings.style_2d.scene_wide) return MakeViewStylizer(settings.style_2d, style);
  std::vector<ColorStatistics> parts;
  for (const CaptureView& view : capture.views)
    parts.push_back(
        MeasureForMethod(settings.style_2d, ReadWorkingPhoto(view, settings.scene.photo_size)));
  const ColorStatistics scene = Pool(parts);
  return MakeViewStylizer(settings.style_2d, style, &scene);
}

}  // namespace regrade
