#include "reconstruct/fit/choose_degree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/field/cpu/render_view.h"
#include "kernels/field/render.h"
#include "kernels/image/decibels.h"
#include "kernels/image/resize.h"

namespace regrade {
namespace {

constexpr int kFold = 5;
constexpr int kResolution = 48;    // voxels along the longest side; the first stage has half
constexpr int kSmallestSide = 24;  // pixels
constexpr int kSteps[] = {100, 200}, kRays = 2048;

// The view scaled so that a voxel of the trial covers as many pixels as one of the full fit.
TrainingView Smaller(const TrainingView& view, double scale, std::vector<Image>* photos) {
  const double longest = std::max(view.camera.width, view.camera.height);
  const double factor = std::min(1.0, std::max(scale, kSmallestSide / longest));
  const int width = std::max(1, static_cast<int>(std::lround(view.camera.width * factor)));
  const int height = std::max(1, static_cast<int>(std::lround(view.camera.height * factor)));
  photos->push_back(Resize(*view.photo, width, height));
  return {view.camera.Resized(width, height), &photos->back()};
}

// Over all pixels of all views that have a colour; masked ones are NaN.
double PsnrOn(const std::vector<TrainingView>& views, const RadianceField& field) {
  const FastGrid grid = MakeFastGrid(field);
  double squares = 0;
  int64_t count = 0;
  for (const TrainingView& view : views) {
    const RenderedView rendered = RenderView(grid, view.camera, field.march);
    for (size_t i = 0; i < view.photo->pixels.size(); ++i) {
      if (!std::isfinite(view.photo->pixels[i])) continue;
      const double value = std::clamp(rendered.color.pixels[i], 0.0f, 1.0f);
      squares += (value - view.photo->pixels[i]) * (value - view.photo->pixels[i]);
      ++count;
    }
  }
  return Decibels(squares / static_cast<double>(count));
}

}  // namespace

DegreeTrial TryDegrees(const std::vector<TrainingView>& views, const SceneBox& box,
                       const FitOptions& options, const ProgressFunction& progress,
                       Backend backend) {
  if (views.size() < kLeastTrialViews) return {std::numeric_limits<double>::infinity()};
  FitOptions small = options;  // with the rates of the fit
  const int resolution = std::min(kResolution, options.resolutions.back());
  small.resolutions = {std::max(8, resolution / 2), resolution};
  small.steps = {kSteps[0], kSteps[1]};
  small.rays_per_step = std::min(kRays, options.rays_per_step);
  const double scale = static_cast<double>(resolution) / options.resolutions.back();
  std::vector<Image> photos;
  photos.reserve(views.size());
  std::vector<TrainingView> fitted, held_out;
  for (size_t i = 0; i < views.size(); ++i) {
    const TrainingView view = Smaller(views[i], scale, &photos);
    // A photo that is almost fully masked may have no pixel left at this size.
    if (HasColor(*view.photo)) (i % kFold == kFold / 2 ? held_out : fitted).push_back(view);
  }
  if (fitted.empty() || held_out.empty()) return {std::numeric_limits<double>::infinity()};

  ProgressParts parts(progress, 2);
  const auto psnr_of_degree = [&](int degree) {
    small.sh_degree = degree;
    FitHooks hooks;
    hooks.progress = parts.Next(1);
    return PsnrOn(held_out, FitField(fitted, box, small, hooks, backend).field);
  };
  const double without = psnr_of_degree(0);
  return {psnr_of_degree(options.sh_degree) - without};
}

}  // namespace regrade
