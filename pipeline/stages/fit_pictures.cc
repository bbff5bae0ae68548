#include "pipeline/stages/fit_pictures.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/capture/scene_profile.h"
#include "reconstruct/fit/adapt_options.h"
#include "reconstruct/fit/fit_field.h"

namespace regrade {
namespace {

// The box in which the scene's own field was fitted; its frame may reach further out.
SceneBox BoxOf(const Capture& capture, const RunSettings& settings, const Vec3f& background) {
  // The box does not depend on exposures, and measuring them would read every photo.
  SceneBox box = ProfileScene(capture, settings.fit.sh_degree,
                              settings.run.effects + ",exposure=off", settings.scene.box)
                     .scene.box;
  if (box.background) box.background = background;
  return box;
}

int DegreeOf(const RadianceField& field) {
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
  std::vector<std::vector<SeenPoint>> seen =
      PointsSeenBy(views.capture(), indices, scene.field_from_world);
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
  FitOptions options = AdaptOptions(settings.fit, {scene.ndc.on(), backend == Backend::kCuda,
                                                   pixels, box.background.has_value()});
  options.seed = settings.run.seed;
  if (settings.run.reproducible && options.shards == 0) options.shards = kReproducibleShards;
  options.sh_degree = std::min(options.sh_degree, DegreeOf(scene.field));
  FitHooks hooks;
  hooks.progress = progress;
  FitResult fit = FitField(training_views, box, options, hooks, backend);
  FittedPictures fitted{{std::move(fit.field), scene.field_from_world, scene.ndc},
                        fit.psnr_train_db};
  RoundAsStored(&fitted.stored.field.appearance);
  return fitted;
}

}  // namespace regrade
