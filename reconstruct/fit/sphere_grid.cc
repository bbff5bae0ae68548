#include "reconstruct/fit/sphere_grid.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/field/background_spheres.h"

namespace regrade {
namespace {

constexpr int kPixelStride = 4, kLayerStride = 2;
constexpr int kDilation = 2;  // texels: the strides miss some at the border

// Dilates by one texel; wraps around in longitude, clamps at the poles.
void Dilate(int resolution, std::vector<uint8_t>* seen) {
  const int columns = 2 * resolution;
  const std::vector<uint8_t> before = *seen;
  for (int x = 0; x < columns; ++x)
    for (int y = 0; y < resolution; ++y) {
      if (!before[static_cast<size_t>(x * resolution + y)]) continue;
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy) {
          const int to_x = (x + dx + columns) % columns;
          const int to_y = std::clamp(y + dy, 0, resolution - 1);
          (*seen)[static_cast<size_t>(to_x * resolution + to_y)] = 1;
        }
    }
}

std::vector<uint8_t> SeenTexels(const TrainingRays& rays, const GridFrame& frame, int layers,
                                int resolution) {
  const size_t map = size_t{2} * resolution * resolution;
  std::vector<std::vector<uint8_t>> partial(static_cast<size_t>(omp_get_max_threads()),
                                            std::vector<uint8_t>(map));
#pragma omp parallel for schedule(dynamic, 1)
  for (int view = 0; view < rays.num_views(); ++view) {
    std::vector<uint8_t>& seen = partial[static_cast<size_t>(omp_get_thread_num())];
    const Camera& camera = rays.camera(view);
    for (int y = 0; y < camera.height; y += kPixelStride)
      for (int x = 0; x < camera.width; x += kPixelStride) {
        const SphereRay<float> ray = ToSphereRay(frame, rays.RayOf(view, x, y));
        if (!(ray.world_per_unit > 0)) continue;
        for (int i = 0; i < layers; i += kLayerStride) {
          Vec3f position;
          float ahead;
          if (!CrossSphere(ray, InverseRadius<float>(i, layers), &position, &ahead)) continue;
          for (const int32_t texel : LocateTexel(resolution, position).texel)
            seen[static_cast<size_t>(texel)] = 1;
        }
      }
  }
  std::vector<uint8_t> seen = std::move(partial[0]);
  for (size_t t = 1; t < partial.size(); ++t)
    for (size_t i = 0; i < map; ++i) seen[i] |= partial[t][i];
  for (int i = 0; i < kDilation; ++i) Dilate(resolution, &seen);
  return seen;
}

// Assigns consecutive numbers to the columns for which `stored` is true.
template <typename Stored>
void LinkColumns(FastSpheres* spheres, const Stored& stored) {
  const int64_t map = int64_t{2} * spheres->resolution * spheres->resolution;
  spheres->links.Resize(map);
  int64_t columns = 0;
  for (int64_t i = 0; i < map; ++i)
    spheres->links[i] = stored(i) ? static_cast<int32_t>(columns++) : -1;
  constexpr int64_t kMost = 1 << 30;  // in addition to the voxels
  if (map * spheres->layers > kMost)
    throw Error(
        ExitCode::kResources,
        "the background would have " + std::to_string(map * spheres->layers) + " texels",
        "reconstruct", "use a smaller background-resolution by --config");
  spheres->texels.Resize(4 * columns * spheres->layers);
}

}  // namespace

int SphereResolutionFor(int resolution, int stage, int last) {
  return std::max(
      8, static_cast<int>(std::lround(static_cast<double>(resolution) * stage / last)));
}

FastSpheres MakeInitialSpheres(const TrainingRays& rays, const GridFrame& frame, int layers,
                               int resolution, float density, const Vec3f& color) {
  FastSpheres spheres;
  spheres.layers = layers;
  spheres.resolution = resolution;
  const std::vector<uint8_t> seen = SeenTexels(rays, frame, layers, resolution);
  LinkColumns(&spheres, [&](int64_t i) { return seen[static_cast<size_t>(i)] != 0; });
  for (int64_t i = 0; i < spheres.num_texels(); ++i) {
    for (int c = 0; c < 3; ++c)
      spheres.texels[4 * i + c] = (color[c] - 0.5f) / static_cast<float>(kSh0);
    spheres.texels[4 * i + 3] = density;
  }
  return spheres;
}

FastSpheres ResampleSpheres(const FastSpheres& spheres, int resolution) {
  FastSpheres result;
  result.layers = spheres.layers;
  result.resolution = resolution;
  const int old = spheres.resolution, layers = spheres.layers;
  const float ratio = static_cast<float>(old) / static_cast<float>(resolution);
  // The four old texels around a new one; longitude wraps around.
  const auto corners = [&](int64_t i, int32_t* column, float* weight) {
    const float x = static_cast<float>(i / resolution) * ratio;
    const float y = static_cast<float>(i % resolution) * ratio;
    const int x0 = std::min(static_cast<int>(x), 2 * old - 1);
    const int y0 = std::min(static_cast<int>(y), old - 1);
    const float fx = x - static_cast<float>(x0), fy = y - static_cast<float>(y0);
    const int x1 = x0 + 1 < 2 * old ? x0 + 1 : 0, y1 = std::min(y0 + 1, old - 1);
    const int at[4] = {x0 * old + y0, x0 * old + y1, x1 * old + y0, x1 * old + y1};
    const float weights[4] = {(1 - fx) * (1 - fy), (1 - fx) * fy, fx * (1 - fy), fx * fy};
    float sum = 0;
    for (int k = 0; k < 4; ++k) {
      column[k] = spheres.links[at[k]];
      weight[k] = column[k] >= 0 ? weights[k] : 0;
      sum += weight[k];
    }
    // Empty corners are ignored, so that columns at the border keep their values.
    for (int k = 0; k < 4 && sum > 0; ++k) weight[k] /= sum;
    return sum > 0;
  };
  LinkColumns(&result, [&](int64_t i) {
    int32_t column[4];
    float weight[4];
    return corners(i, column, weight);
  });
#pragma omp parallel for schedule(static)
  for (int64_t i = 0; i < result.links.size(); ++i) {
    if (result.links[i] < 0) continue;
    int32_t column[4];
    float weight[4];
    corners(i, column, weight);
    float* const to = result.texels.data() + 4 * int64_t{layers} * result.links[i];
    for (int k = 0; k < 4; ++k) {
      if (weight[k] == 0) continue;
      const float* const from = spheres.texels.data() + 4 * int64_t{layers} * column[k];
      for (int v = 0; v < 4 * layers; ++v) to[v] += weight[k] * from[v];
    }
  }
  return result;
}

}  // namespace regrade
