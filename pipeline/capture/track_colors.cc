#include "pipeline/capture/track_colors.h"

#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "kernels/scene/srgb.h"
#include "pipeline/images/image_file.h"
#include "reconstruct/refinement/exposure_folds.h"
#include "reconstruct/refinement/lens_falloff.h"

namespace regrade {
namespace {

// Half a window of 5: a few reprojection errors wide, so that a displaced point still shows
// mostly the same surface.
constexpr int kRadius = 2;
// Encoded values. Below, one step of 8 bits is 15 % of the light; above, camera curves
// saturate.
constexpr float kDarkest = 15.0f / 255, kBrightest = 243.0f / 255;
constexpr float kWhite = 254.0f / 255;  // one step of tolerance for compression

constexpr int kFoldLevels = 4;
static_assert(1 << kFoldLevels == kExposureFolds);

Vec3d ClippedFraction(const Image& photo) {
  Vec3d fraction;
  for (size_t i = 0; i < photo.pixels.size(); ++i)
    if (photo.pixels[i] >= kWhite) fraction[static_cast<int>(i % 3)] += 1;
  return fraction / static_cast<double>(photo.num_pixels());
}

}  // namespace

bool WindowLight(const Image& photo, double u, double v, Vec3d* light) {
  // Pixel centres are at + 0.5: the 6 x 6 pixels of the bilinear samples begin here.
  const double x = std::floor(u - 0.5), y = std::floor(v - 0.5);
  const double right = u - 0.5 - x, below = v - 0.5 - y;  // weights of the far side
  if (!(x >= kRadius && y >= kRadius && x + kRadius + 1 < photo.width &&
        y + kRadius + 1 < photo.height))
    return false;
  Vec3d sum;
  for (int dy = -kRadius; dy <= kRadius + 1; ++dy) {
    const double row = dy == -kRadius ? 1 - below : dy == kRadius + 1 ? below : 1;
    for (int dx = -kRadius; dx <= kRadius + 1; ++dx) {
      const double column = dx == -kRadius ? 1 - right : dx == kRadius + 1 ? right : 1;
      const float* const pixel = photo.at(static_cast<int>(x) + dx, static_cast<int>(y) + dy);
      for (int c = 0; c < 3; ++c) {
        if (!(pixel[c] >= kDarkest && pixel[c] <= kBrightest)) return false;
        sum[c] += row * column * LinearFromSrgb(pixel[c]);
      }
    }
  }
  *light = sum / ((2 * kRadius + 1) * (2 * kRadius + 1));
  return true;
}

TrackColors ReadTrackColors(const Capture& capture) {
  std::vector<std::vector<int32_t>> points_of_view(capture.views.size());
  for (size_t p = 0; p < capture.points.size(); ++p)
    for (const int32_t v : capture.points[p].views)
      points_of_view[v].push_back(static_cast<int32_t>(p));
  std::vector<Vec3d> positions;
  for (const ScenePoint& point : capture.points) positions.push_back(point.position);
  const std::vector<int> folds = SpatialFolds(positions, kFoldLevels);
  const auto of_view = [&](int64_t i) {
    const auto v = static_cast<size_t>(i);
    const CaptureView& view = capture.views[v];
    const Image photo = ReadImage(view.path);
    if (photo.channels != 3) throw InputError("not an RGB picture", view.path);
    TrackColors own{{}, {ClippedFraction(photo)}};
    for (const int32_t p : points_of_view[v]) {
      double x = 0, y = 0;
      ColorObservation observation{static_cast<int32_t>(v), p, {}, folds[p]};
      if (view.camera.Project(capture.points[p].position, &x, &y) &&
          WindowLight(photo, x, y, &observation.light)) {
        observation.radius2 = Radius2(photo.width, photo.height, x, y);
        own.observations.push_back(observation);
      }
    }
    return own;
  };
  TrackColors colors;
  MakeAhead(std::ssize(capture.views), LargestPhotoBytes(capture), of_view,
            [&colors](int64_t, const TrackColors& own) {
              colors.clipped.push_back(own.clipped[0]);
              colors.observations.insert(colors.observations.end(), own.observations.begin(),
                                         own.observations.end());
            });
  return colors;
}

}  // namespace regrade
