#include "reconstruct/training_rays.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/base/random.h"

namespace regrade {
namespace {

bool SameLens(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.lens == b.lens && a.distortion == b.distortion;
}

std::vector<Vec3f> DirectionMap(const Camera& camera) {
  std::vector<Vec3f> map(static_cast<size_t>(camera.width) * camera.height);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      map[static_cast<size_t>(y) * camera.width + x] =
          Normalized(camera.CameraRay(x + 0.5, y + 0.5)).Cast<float>();
  return map;
}

// Interleaves the bits of x and y: near in the plane is near in the order.
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
    while (lens < lenses.size() && !SameLens(lenses[lens], view.camera)) ++lens;
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
    for (size_t i = 0; i < photo.pixels.size(); ++i) {
      const float value = std::clamp(photo.pixels[i], 0.0f, 1.0f);
      stored.color[i] = static_cast<uint16_t>(std::lround(value * 65535.0f));
      view_sum[static_cast<int>(i % 3)] += value;
    }
    sum += view_sum;
    total_ += photo.num_pixels();
    views_.push_back(std::move(stored));
  }
  mean_color_ = (sum / static_cast<double>(total_)).Cast<float>();
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
                       view.camera.height, view.direction_map, view.color.data()});
  return DeviceViews(direction_maps_, sources);
}

void TrainingRays::Draw(uint64_t seed, uint64_t step, int patches, int patch,
                        std::vector<Ray>* rays, std::vector<Vec3f>* targets) const {
  struct Corner {
    int view, x, y;
    uint64_t order;
  };
  std::vector<Corner> corners(static_cast<size_t>(patches));
  // A random rotation of the views, then equal shares: no view is left out of a batch by
  // chance.
  const double turn = RandomDouble(seed, step, 0);
  for (int p = 0; p < patches; ++p) {
    const double position = (p + turn) / patches * num_views();
    const int view = static_cast<int>(position) % num_views();
    const Camera& camera = views_[static_cast<size_t>(view)].camera;
    const uint64_t counter = 1 + 2 * static_cast<uint64_t>(p);
    const int x = static_cast<int>(RandomIndex(
        seed, step, counter, static_cast<uint64_t>(std::max(1, camera.width - patch + 1))));
    const int y = static_cast<int>(
        RandomIndex(seed, step, counter + 1,
                    static_cast<uint64_t>(std::max(1, camera.height - patch + 1))));
    corners[static_cast<size_t>(p)] = {
        view, x, y, Morton(static_cast<uint32_t>(x), static_cast<uint32_t>(y))};
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
        const int x = std::min(corner.x + dx, view.camera.width - 1);
        const int y = std::min(corner.y + dy, view.camera.height - 1);
        rays->push_back(RayOf(corner.view, x, y));
        const uint16_t* c = &view.color[(static_cast<size_t>(y) * view.camera.width + x) * 3];
        targets->push_back({c[0] / 65535.0f, c[1] / 65535.0f, c[2] / 65535.0f});
      }
  }
}

}  // namespace regrade
