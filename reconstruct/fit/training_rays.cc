#include "reconstruct/fit/training_rays.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/base/vec.h"

namespace regrade {
namespace {

std::vector<Vec3f> DirectionMap(const Camera& camera) {
  std::vector<Vec3f> map(static_cast<size_t>(camera.width) * camera.height);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      map[static_cast<size_t>(y) * camera.width + x] =
          Normalized(camera.CameraRay(x + 0.5, y + 0.5)).Cast<float>();
  return map;
}

// Interleaves the bits of x and y: pixels that are close in the image are close in the order.
uint64_t Morton(uint32_t x, uint32_t y) {
  const auto spread = [](uint64_t v) {
    v = (v | (v << 16)) & 0x0000ffff0000ffffull;
    v = (v | (v << 8)) & 0x00ff00ff00ff00ffull;
    v = (v | (v << 4)) & 0x0f0f0f0f0f0f0f0full;
    v = (v | (v << 2)) & 0x3333333333333333ull;
    return (v | (v << 1)) & 0x5555555555555555ull;
  };
  return spread(x) | (spread(y) << 1);
}

}  // namespace

TrainingRays::TrainingRays(const std::vector<TrainingView>& views) {
  REGRADE_CHECK(!views.empty());
  std::vector<Camera> lenses;
  Vec3d sum{};
  for (const TrainingView& view : views) {
    const Image& photo = *view.photo;
    REGRADE_CHECK_EQ(photo.width, view.camera.width);
    REGRADE_CHECK_EQ(photo.height, view.camera.height);
    REGRADE_CHECK_EQ(photo.channels, 3);
    size_t lens = 0;
    while (lens < lenses.size() && !lenses[lens].SameIntrinsics(view.camera)) ++lens;
    if (lens == lenses.size()) {
      lenses.push_back(view.camera);
      direction_maps_.push_back(DirectionMap(view.camera));
    }
    StoredView stored{view.camera,
                      static_cast<int>(lens),
                      view.camera.Center().Cast<float>(),
                      view.camera.camera_from_world.rotation.Transposed().Cast<float>(),
                      {}};
    stored.color.resize(photo.pixels.size());
    Vec3d view_sum{};
    stored.drawn = DrawnPixels(photo);
    for (const int32_t pixel : stored.drawn)
      for (int c = 0; c < 3; ++c) {
        const size_t at = 3 * static_cast<size_t>(pixel) + static_cast<size_t>(c);
        const float value = std::clamp(photo.pixels[at], 0.0f, 1.0f);
        stored.color[at] = static_cast<uint16_t>(std::lround(value * 65535.0f));
        view_sum[c] += value;
      }
    if (stored.drawn.empty())
      throw Error(ExitCode::kInput,
                  "view " + std::to_string(views_.size()) + " has no unmasked pixel to fit", "",
                  "check its mask");
    sum += view_sum;
    total_ += static_cast<int64_t>(stored.drawn.size());
    if (static_cast<int64_t>(stored.drawn.size()) == photo.num_pixels())
      stored.drawn = std::vector<int32_t>();
    views_.push_back(std::move(stored));
  }
  mean_color_ = (sum / static_cast<double>(total_)).Cast<float>();
}

bool TrainingRays::StoredView::IsMasked(int64_t pixel) const {
  return !drawn.empty() &&
         !std::binary_search(drawn.begin(), drawn.end(), static_cast<int32_t>(pixel));
}

Ray TrainingRays::RayOf(int view, int x, int y) const {
  const StoredView& v = views_[static_cast<size_t>(view)];
  const Vec3f& d = direction_maps_[static_cast<size_t>(v.direction_map)]
                                  [static_cast<size_t>(y) * v.camera.width + x];
  Ray ray{v.origin, v.world_from_camera * d};
  if (v.camera.ndc.on()) NdcRay(v.camera.ndc, &ray.origin, &ray.direction);
  return ray;
}

DeviceViews TrainingRays::ToDevice() const {
  std::vector<DeviceViewSource> sources;
  for (const StoredView& view : views_)
    sources.push_back({view.origin, view.world_from_camera, view.camera.ndc, view.camera.width,
                       view.camera.height, view.direction_map, view.color.data(),
                       view.drawn.data(), static_cast<int32_t>(view.drawn.size())});
  return DeviceViews(direction_maps_, sources);
}

void TrainingRays::Draw(uint64_t seed, uint64_t step, int patches, int patch,
                        std::vector<Ray>* rays, std::vector<Vec3f>* targets) const {
  struct Corner {
    int view, x, y;
    uint64_t order;
    int64_t pixel;  // an unmasked pixel within the square; -1 if the view has no mask
  };
  std::vector<Corner> corners(static_cast<size_t>(patches));
  // Stratified over the views from a random start, so that every view is in every batch.
  const double turn = RandomDouble(seed, step, 0);
  for (int p = 0; p < patches; ++p) {
    const double position = (p + turn) / patches * num_views();
    const int view = static_cast<int>(position) % num_views();
    const StoredView& stored = views_[static_cast<size_t>(view)];
    const uint64_t counter = 1 + 2 * static_cast<uint64_t>(p);
    const int columns = std::max(1, stored.camera.width - patch + 1);
    const int rows = std::max(1, stored.camera.height - patch + 1);
    int x, y;
    int64_t pixel = -1;
    if (stored.drawn.empty()) {
      x = static_cast<int>(RandomIndex(seed, step, counter, static_cast<uint64_t>(columns)));
      y = static_cast<int>(RandomIndex(seed, step, counter + 1, static_cast<uint64_t>(rows)));
    } else {
      pixel = stored.drawn[RandomIndex(seed, step, counter, stored.drawn.size())];
      // A square that contains the pixel at a random position.
      const int within = static_cast<int>(
          RandomIndex(seed, step, counter + 1,
                      static_cast<uint64_t>(patch) * static_cast<uint64_t>(patch)));
      x = std::clamp(static_cast<int>(pixel % stored.camera.width) - within % patch, 0,
                     columns - 1);
      y = std::clamp(static_cast<int>(pixel / stored.camera.width) - within / patch, 0,
                     rows - 1);
    }
    corners[static_cast<size_t>(p)] = {
        view, x, y, Morton(static_cast<uint32_t>(x), static_cast<uint32_t>(y)), pixel};
  }
  std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
    return a.view != b.view ? a.view < b.view : a.order < b.order;
  });
  rays->clear();
  targets->clear();
  for (const Corner& corner : corners) {
    const StoredView& view = views_[static_cast<size_t>(corner.view)];
    for (int dy = 0; dy < patch; ++dy)
      for (int dx = 0; dx < patch; ++dx) {
        const int64_t width = view.camera.width;
        int64_t pixel = std::min(corner.y + dy, view.camera.height - 1) * width +
                        std::min(corner.x + dx, view.camera.width - 1);
        if (view.IsMasked(pixel)) pixel = corner.pixel;
        rays->push_back(RayOf(corner.view, static_cast<int>(pixel % width),
                              static_cast<int>(pixel / width)));
        const uint16_t* c = &view.color[static_cast<size_t>(pixel) * 3];
        targets->push_back({c[0] / 65535.0f, c[1] / 65535.0f, c[2] / 65535.0f});
      }
  }
}

std::vector<int32_t> DrawnPixels(const Image& photo) {
  std::vector<int32_t> drawn;
  for (int y = 0; y < photo.height; ++y)
    for (int x = 0; x < photo.width; ++x) {
      const int32_t pixel = y * photo.width + x;
      const float* const color = &photo.pixels[static_cast<size_t>(3 * int64_t{pixel})];
      if (AllFinite(Vec3f{color[0], color[1], color[2]})) drawn.push_back(pixel);
    }
  return drawn;
}

}  // namespace regrade
