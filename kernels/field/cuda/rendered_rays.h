// The rays of a rendering: from a list or of a frame. Device code only.
#pragma once

#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/warp_layers.h"
#include "kernels/field/resolve_pixel.h"
#include "kernels/scene/pinhole_rays.h"

#if defined(__CUDACC__)

namespace regrade {

inline constexpr int kRenderedRays =
    8;  // per block; 16 are as fast, 32 lose what neighbours share

// Rays from a list; sums are stored unchanged. A block processes kRenderedRays of them.
struct ListedRays {
  const Ray* rays;
  int64_t n;

  // The index-th ray and the index of its results; false past the last.
  __device__ bool Get(int64_t index, Ray* ray, int64_t* place) const {
    *place = index;
    if (index >= n) return false;
    *ray = rays[*place];
    return true;
  }
  __device__ void Resolve(const Ray&, float, Vec3f*, float*) const {}
  int64_t Blocks() const { return (n + kRenderedRays - 1) / kRenderedRays; }
};

// The rays of a frame. Concurrent warps process neighbouring pixels, which read the same
// voxels: square tiles one after the other, Morton order within each.
struct FrameRays {
  static constexpr int kTile = 16, kPixels = kTile * kTile;
  PinholeRays camera;
  ResolvePixel resolve;

  HD int Columns() const { return (camera.width + kTile - 1) / kTile; }
  __device__ bool Get(int64_t index, Ray* ray, int64_t* place) const {
    const int tile = static_cast<int>(index / kPixels);
    int x = tile % Columns() * kTile, y = tile / Columns() * kTile;
#pragma unroll
    for (int bit = 0; bit < 4; ++bit) {
      x += static_cast<int>(index >> (2 * bit) & 1) << bit;
      y += static_cast<int>(index >> (2 * bit + 1) & 1) << bit;
    }
    if (x >= camera.width || y >= camera.height) return false;
    *ray = camera.At(x, y);
    *place = int64_t{y} * camera.width + x;
    return true;
  }
  __device__ void Resolve(const Ray& ray, float transmittance, Vec3f* color,
                          float* depth) const {
    resolve(ray, transmittance, color, depth);
  }
  int64_t Blocks() const {
    return int64_t{Columns()} * ((camera.height + kTile - 1) / kTile) *
           (kPixels / kRenderedRays);
  }
};

// Continues behind the box for a field with layers; one warp per ray.
template <typename Rays>
__global__ void RenderSpheresKernel(DeviceGridView grid, Rays rays, float stop,
                                    DeviceRenderTarget target) {
  Ray ray;
  int64_t place;
  if (!rays.Get((blockIdx.x * int64_t{blockDim.x} + threadIdx.x) / 32, &ray, &place)) return;
  WarpLayers layers(grid, ray, target.transmittance[place], stop);
  LaneLayer mine;
  unsigned composited;
  Vec3f color{};
  float depth = 0;
  while (layers.Next(&mine, &composited)) {
    if (!(mine.tau > 0)) continue;
    const float w = mine.Weight();
    color += mine.Color() * w;
    depth += w * mine.depth;
  }
  for (int c = 0; c < 3; ++c) color[c] = WarpSum(color[c]);
  depth = target.depth[place] + WarpSum(depth);
  if (layers.lane() != 0) return;
  const float transmittance = layers.transmittance();
  color += target.color[place] + grid.background * transmittance;
  rays.Resolve(ray, transmittance, &color, &depth);
  target.color[place] = color;
  target.depth[place] = depth;
  target.transmittance[place] = transmittance;
}

}  // namespace regrade

#endif
