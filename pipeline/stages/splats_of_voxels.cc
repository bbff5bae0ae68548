#include "pipeline/stages/splats_of_voxels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "kernels/splats/splat_field.h"
#include "pipeline/run/profile_run.h"
#include "reconstruct/splats/fit_splats.h"

namespace regrade {
namespace {

constexpr int kLongestSide = 640;    // of the renders, in pixels
constexpr float kMostBehind = 0.3f;  // transmittance of a pixel with a start
constexpr float kMostSlope = 0.05f;  // of depth, from a pixel to its neighbours

Camera In(const StoredField& stored, const Camera& camera) {
  Camera in = camera.Transformed(stored.field_from_world);
  in.ndc = stored.ndc;
  return in;
}

bool ShowsSurface(const RenderedView& view, int x, int y) {
  const float depth = *view.depth.at(x, y);
  if (!(depth > 0) || *view.transmittance.at(x, y) > kMostBehind) return false;
  for (const auto& [nx, ny] : {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
    if (nx < 0 || ny < 0 || nx >= view.depth.width || ny >= view.depth.height) continue;
    if (!(std::abs(*view.depth.at(nx, ny) - depth) < kMostSlope * depth)) return false;
  }
  return true;
}

// How much the colour changes from a pixel to the next ones.
float Contrast(const Image& color, int x, int y) {
  float most = 0;
  for (const auto& [nx, ny] : {std::pair{x + 1, y}, {x, y + 1}}) {
    if (nx >= color.width || ny >= color.height) continue;
    for (int c = 0; c < 3; ++c)
      most = std::max(most, std::abs(color.at(nx, ny)[c] - color.at(x, y)[c]));
  }
  return most;
}

// About `count` places on surfaces in the frame of `camera`, more where colours change.
// `scale`: the unit of the depths over that of the frame.
std::vector<SeenPoint> Starts(const RenderedView& view, const Camera& camera, double scale,
                              double count) {
  constexpr float kEven = 0.03f;  // weight of a place without contrast
  std::vector<float> weights(static_cast<size_t>(view.color.num_pixels()));
  double sum = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      if (!ShowsSurface(view, x, y)) continue;
      const float weight = kEven + Contrast(view.color, x, y);
      weights[static_cast<size_t>(y) * camera.width + x] = weight;
      sum += weight;
    }
  if (!(sum > 0)) return {};
  const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
  std::vector<SeenPoint> starts;
  double at = 0.5;
  for (size_t i = 0; i < weights.size(); ++i) {
    at += weights[i] / sum * count;
    if (!(at >= 1)) continue;
    at -= std::floor(at);
    const int x = static_cast<int>(i % camera.width), y = static_cast<int>(i / camera.width);
    const Vec3d place = world_from_camera * (camera.CameraRay(x + 0.5, y + 0.5) *
                                             (double{*view.depth.at(x, y)} * scale));
    starts.push_back({place.Cast<float>(), 0});
  }
  return starts;
}

}  // namespace

SplatsOfVoxels::SplatsOfVoxels(const Capture& capture, const RunSettings& settings,
                               const SplatsOfVoxelsOptions& options, Backend backend)
    : options_(options), backend_(backend) {
  RunSettings of_splats = settings;
  of_splats.scene.field = "splats";
  scene_ = SceneOfRun(of_splats, capture);
  const int size = std::min(kLongestSide, settings.scene.photo_size);
  const std::vector<Camera> cameras = WorkingViews(capture, size, 0).Pinholes().Cameras();
  views_ = ViewsNear(cameras, options.renders);
  // Renders show a field without noise from as many places as are asked for: nothing holds the
  // splats back, and none of them is moved at random.
  fit_.seed = settings.run.seed;
  fit_.steps = options.steps;
  fit_.thousands = options.thousands;
  fit_.sh_degree = std::min(2, settings.fit.sh_degree);
  fit_.opacity_weight = fit_.scale_weight = fit_.noise = fit_.dropout = 0;
  fit_.initial_opacity = 0.8f;
  fit_.initial_scale = 0.5f;
  fit_.long_from = 0;  // rates fall
}

StoredField SplatsOfVoxels::FitTo(const StoredField& voxels, const SplatFitOptions& fit,
                                  Splats* splats, const ProgressFunction& progress) const {
  ProgressParts parts(progress, 7);
  const FieldRenderer renderer(voxels.field, backend_);
  std::vector<Image> renders;
  renders.reserve(views_.fitted.size());  // pointers to its elements are kept
  std::vector<TrainingView> training;
  const double count = static_cast<double>(views_.fitted.size());
  const ProgressFunction rendering = parts.Next(1);
  for (const Camera& camera : views_.fitted) {
    ReportOrThrow(rendering, static_cast<double>(renders.size()), count);
    RenderedView view = renderer.Render(In(voxels, camera));
    const Camera in_splats = camera.Transformed(scene_.field_from_world);
    std::vector<SeenPoint> starts;
    if (splats->count() == 0)
      starts =
          Starts(view, in_splats, scene_.field_from_world.scale / voxels.field_from_world.scale,
                 1000.0 * fit.thousands / count);
    renders.push_back(std::move(view.color));
    training.push_back({in_splats, &renders.back(), std::move(starts)});
  }
  SceneBox box = scene_.box;
  box.background = voxels.field.background;
  SplatFitHooks hooks;
  hooks.progress = parts.Next(6);
  SplatFitState begin;
  if (splats->count() > 0) {
    begin.first_moment = begin.second_moment = Splats(splats->count(), splats->basis);
    begin.splats = std::move(*splats);
    begin.splats.background = voxels.field.background;
    hooks.resume = &begin;
  }
  SplatFitResult fitted = FitSplats(training, box, fit, hooks, backend_);
  *splats = std::move(fitted.splats);
  return {FieldOfSplats(*splats, {{}, box.center, box.radius}, box.near_clip, fitted.fit_pixel),
          scene_.field_from_world,
          {}};
}

StoredField SplatsOfVoxels::Fit(const StoredField& voxels, const ProgressFunction& progress) {
  splats_ = {};
  return FitTo(voxels, fit_, &splats_, progress);
}

StoredField SplatsOfVoxels::Recolor(const StoredField& voxels,
                                    const ProgressFunction& progress) const {
  constexpr float kFaster = 4;  // than colours that geometry follows
  SplatFitOptions fit = fit_;
  fit.steps = options_.color_steps;
  fit.ssim_weight = 0;
  fit.rate_color *= kFaster;
  fit.rate_view *= kFaster;
  fit.rate_scale = fit.rate_quaternion = fit.rate_opacity = 0;
  fit.rate_mean = fit.rate_mean_end = 1e-12f;  // a ratio is taken of them
  fit.grow_from = 1;                           // nothing is moved or added
  Splats splats = splats_;
  return FitTo(voxels, fit, &splats, progress);
}

std::vector<Camera> SplatsOfVoxels::MeasuredViews(const StoredField& stored) const {
  std::vector<Camera> cameras;
  for (const Camera& camera : views_.measured) cameras.push_back(In(stored, camera));
  return cameras;
}

}  // namespace regrade
