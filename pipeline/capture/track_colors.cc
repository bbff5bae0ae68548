#include "pipeline/capture/track_colors.h"

#include <cmath>

#include "kernels/base/error.h"
#include "kernels/scene/srgb.h"
#include "pipeline/images/image_file.h"
#include "reconstruct/refinement/exposure_folds.h"

namespace regrade {
namespace {

// Half a window of 5: as wide as a few reprojection errors, so that a point beside its true
// place still shows mostly the same surface.
constexpr int kReach = 2;
// Encoded values. Below, one step of 8 bits is 15 % of the light; above, cameras roll their
// curve off.
constexpr float kDarkest = 15.0f / 255, kBrightest = 243.0f / 255;
constexpr float kWhite = 254.0f / 255;  // one step for compression to err by

constexpr int kFoldLevels = 4;
static_assert(1 << kFoldLevels == kExposureFolds);

Vec3d ClippedShare(const Image& photo) {
  Vec3d share;
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    if (photo.pixels[i] >= kWhite) share[static_cast<int>(i % 3)] += 1;
  return share / static_cast<double>(photo.num_pixels());
}

}  // namespace

bool WindowLight(const Image& photo, double u, double v, Vec3d* light) {
  // Pixel centres are at + 0.5: the window of 6 x 6 pixels that its bilinear samples touch
  // begins here.
  const double x = std::floor(u - 0.5), y = std::floor(v - 0.5);
  const double right = u - 0.5 - x, below = v - 0.5 - y;  // weights of the far side
  if (!(x >= kReach && y >= kReach && x + kReach + 1 < photo.width &&
        y + kReach + 1 < photo.height))
    return false;
  Vec3d sum;
  for (int dy = -kReach; dy <= kReach + 1; ++dy) {
    const double row = dy == -kReach ? 1 - below : dy == kReach + 1 ? below : 1;
    for (int dx = -kReach; dx <= kReach + 1; ++dx) {
      const double column = dx == -kReach ? 1 - right : dx == kReach + 1 ? right : 1;
      const float* const pixel = photo.at(static_cast<int>(x) + dx, static_cast<int>(y) + dy);
      for (int c = 0; c < 3; ++c) {
        if (!(pixel[c] >= kDarkest && pixel[c] <= kBrightest)) return false;
        sum[c] += row * column * LinearFromSrgb(pixel[c]);
      }
    }
  }
  *light = sum / ((2 * kReach + 1) * (2 * kReach + 1));
  return true;
}

TrackColors ReadTrackColors(const Capture& capture) {
  std::vector<std::vector<int32_t>> seen_in(capture.views.size());
  for (size_t p = 0; p < capture.points.size(); ++p)
    for (const int32_t v : capture.points[p].views)
      seen_in[static_cast<size_t>(v)].push_back(static_cast<int32_t>(p));
  std::vector<Vec3d> places;
  for (const ScenePoint& point : capture.points) places.push_back(point.position);
  const std::vector<int> folds = SpatialFolds(places, kFoldLevels);
  TrackColors colors;
  for (size_t v = 0; v < capture.views.size(); ++v) {
    const CaptureView& view = capture.views[v];
    const Image photo = ReadImage(view.path);
    if (photo.channels != 3) throw Error(ExitCode::kInput, "not an RGB picture", view.path);
    colors.clipped.push_back(ClippedShare(photo));
    for (const int32_t p : seen_in[v]) {
      double x = 0, y = 0;
      ColorObservation observation{
          static_cast<int32_t>(v), p, {}, folds[static_cast<size_t>(p)]};
      if (view.camera.Project(capture.points[static_cast<size_t>(p)].position, &x, &y) &&
          WindowLight(photo, x, y, &observation.light))
        colors.observations.push_back(observation);
    }
  }
  return colors;
}

}  // namespace regrade
