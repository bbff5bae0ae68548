#include "pipeline/stages/fit_pictures.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/capture/measured_depths.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/profile_run.h"

namespace regrade {
namespace {

// The box in which the scene's own field was fitted; its frame may reach further out.
SceneBox BoxOf(const Capture& capture, const RunSettings& settings, const Vec3f& background) {
  SceneBox box = SceneOfRun(settings, capture).box;
  if (box.background) box.background = background;
  return box;
}

int DegreeOfField(const RadianceField& field) {
  return static_cast<int>(std::lround(std::sqrt(field.appearance.basis))) - 1;
}

bool ShowsSomething(const Image& picture) {
  return std::ranges::any_of(picture.pixels, [](float v) { return std::isfinite(v); });
}

}  // namespace

FittedPictures FitPictures(const WorkingViews& views, const StoredField& scene,
                           const std::vector<int>& indices,
                           const std::function<Image(int)>& picture,
                           const RunSettings& settings, const Vec3f& background,
                           Backend backend, const ProgressFunction& progress) {
  std::vector<Image> pictures;
  pictures.reserve(indices.size());  // pointers to its elements are kept
  std::vector<TrainingView> training_views;
  std::vector<std::string> said_before;
  std::vector<std::vector<SeenPoint>> seen =
      PointsOfViews(views.capture(), indices, scene.field_from_world, &said_before);
  int64_t pixels = 0;
  for (size_t k = 0; k < indices.size(); ++k) {
    Image image = picture(indices[k]);
    if (!ShowsSomething(image)) continue;
    pixels += image.num_pixels();
    pictures.push_back(std::move(image));
    training_views.push_back(
        {views.CameraOf(indices[k]), &pictures.back(), std::move(seen[k])});
  }
  if (training_views.empty())
    throw InputError("the 2D method has a picture of none of the photos", "views_2d");
  const SceneBox box = BoxOf(views.capture(), settings, background);
  const std::unique_ptr<FieldFit> fit = FitKindOf(settings).make(
      settings,
      {.backend = backend, .pixels = pixels, .photos = std::ssize(training_views), .box = box});
  fit->LimitDegree(DegreeOfField(scene.field));
  FittedField field =
      fit->Run(training_views, {.progress = progress, .checkpoint = {}, .note = ""});
  FittedPictures fitted{{std::move(field.field), scene.field_from_world, scene.ndc},
                        field.psnr_train_db};
  RoundAsStored(&fitted.stored.field.appearance);
  return fitted;
}

}  // namespace regrade
