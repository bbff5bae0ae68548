#include "reconstruct/splats/splat_photos.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "kernels/base/error.h"
#include "kernels/image/resize.h"
#include "kernels/image/undistort_photo.h"

namespace regrade {
namespace {

SplatPhoto Stored(const Image& photo, const Camera& camera) {
  SplatPhoto stored{camera, {}, {}, {}};
  stored.color.resize(photo.pixels.size());
  std::vector<uint8_t> masked(static_cast<size_t>(photo.num_pixels()));
  for (size_t i = 0; i < stored.color.size(); ++i) {
    const float value = photo.pixels[i];
    if (std::isfinite(value))
      stored.color[i] =
          static_cast<uint16_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 65535.0f));
    else
      masked[i / 3] = 1;
  }
  if (std::ranges::find(masked, 1) != masked.end()) stored.masked = std::move(masked);
  return stored;
}

// At pixels that show two points, that of the more certain one.
std::vector<SeenDepth> DepthsOf(const std::vector<SeenPoint>& points, const SplatPhoto& photo) {
  std::map<int32_t, SeenDepth> best;
  const Camera& camera = photo.camera;
  for (const SeenPoint& point : points) {
    double u, v, z;
    if (!camera.Project(point.position.Cast<double>(), &u, &v, &z)) continue;
    if (!(u >= 0 && v >= 0 && u < camera.width && v < camera.height)) continue;
    const int32_t pixel = static_cast<int32_t>(v) * camera.width + static_cast<int32_t>(u);
    if (!photo.masked.empty() && photo.masked[static_cast<size_t>(pixel)] != 0) continue;
    const float depth = static_cast<float>(z);
    const SeenDepth seen{pixel, depth, std::max(kLeastDepthError, point.sigma / depth)};
    const auto [at, fresh] = best.emplace(pixel, seen);
    if (!fresh && seen.error < at->second.error) at->second = seen;
  }
  std::vector<SeenDepth> depths;
  for (const auto& [pixel, seen] : best) depths.push_back(seen);
  return depths;
}

}  // namespace

SplatPhotos::SplatPhotos(const std::vector<TrainingView>& views, double shrink) {
  REGRADE_CHECK(!views.empty());
  for (const TrainingView& view : views) Add(view, shrink);
}

void SplatPhotos::Add(const TrainingView& view, double shrink) {
  REGRADE_CHECK(shrink >= 1 && !view.camera.ndc.on() && view.photo->channels == 3);
  const auto smaller = [&](int side) {
    return std::max(1, static_cast<int>(std::lround(side / shrink)));
  };
  Image photo = UndistortPhoto(*view.photo, view.camera);
  const int width = smaller(photo.width), height = smaller(photo.height);
  photo = Resize(photo, width, height);
  if (!HasColor(photo))
    throw Error(ExitCode::kInput,
                Concat("view ", photos_.size(), " has no unmasked pixel to fit"), "",
                "check its mask");
  photos_.push_back(Stored(photo, view.camera.Undistorted().Resized(width, height)));
  photos_.back().depths = DepthsOf(view.points, photos_.back());
}

int64_t SplatPhotos::num_pixels() const {
  int64_t pixels = 0;
  for (const SplatPhoto& photo : photos_)
    pixels += int64_t{photo.camera.width} * photo.camera.height;
  return pixels;
}

float SplatPhotos::pixel() const {
  constexpr double kAlike = 1.05;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (const SplatPhoto& photo : photos_) {
    const double focal = std::sqrt(photo.camera.fx * photo.camera.fy);
    least = std::min(least, focal);
    most = std::max(most, focal);
  }
  return most <= kAlike * least ? static_cast<float>(1 / std::sqrt(least * most)) : -1.0f;
}

Vec3f SplatPhotos::mean_color() const {
  Vec3d sum{};
  int64_t count = 0;
  for (const SplatPhoto& photo : photos_)
    for (size_t pixel = 0; 3 * pixel < photo.color.size(); ++pixel) {
      if (!photo.masked.empty() && photo.masked[pixel] != 0) continue;
      for (size_t c = 0; c < 3; ++c)
        sum[static_cast<int>(c)] += photo.color[3 * pixel + c] / 65535.0;
      ++count;
    }
  return (sum / static_cast<double>(count)).Cast<float>();
}

}  // namespace regrade
