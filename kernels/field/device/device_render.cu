// Rendering and the largest weights of voxels, a warp a ray.
#include "kernels/field/device/device_rays.h"
#include "kernels/field/device/launch.h"
#include "kernels/field/device/warp_shade.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

template <int kBasis>
__global__ void RenderRaysKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                 MarchOptions options, DeviceRenderTarget target) {
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  const Ray ray = rays[r];
  const WarpRecord<kBasis> record(lane, ray.direction);
  WarpMarch march(grid, ray, options);
  LaneSample sample;
  unsigned composited;
  Vec3f color{};
  float depth = 0;
  while (march.Next(&sample, &composited)) {
    const Vec3f raw = RawColors<kBasis>(grid, record, sample, composited, lane);
    if (!(sample.tau > 0)) continue;
    const float w = sample.transmittance_before * Opacity(sample.tau);
    for (int c = 0; c < 3; ++c) color[c] += w * fmaxf(raw[c], 0.0f);
    depth += w * sample.t;
  }
  const float left = expf(-march.optical_depth());
  for (int c = 0; c < 3; ++c) color[c] = WarpSum(color[c]) + grid.background[c] * left;
  depth = WarpSum(depth) * march.world_per_voxel();
  if (lane != 0) return;
  target.color[r] = color;
  target.depth[r] = depth;
  target.transmittance[r] = left;
}

// Positive floats are ordered as their bits.
__device__ void RaiseTo(float* target, float value) {
  if (*target < value) atomicMax(reinterpret_cast<int*>(target), __float_as_int(value));
}

__global__ void MaxWeightsKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                 MarchOptions options, float* weights) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  WarpMarch march(grid, rays[r], options);
  LaneSample sample;
  unsigned composited;
  while (march.Next(&sample, &composited)) {
    if (!(sample.tau > 0)) continue;
    const float w = sample.transmittance_before * Opacity(sample.tau);
    for (int k = 0; k < 8; ++k) {
      const int32_t link = grid.links[sample.cell.vertex + CornerOffset(grid.frame, k)];
      if (link >= 0) RaiseTo(&weights[link], w);
    }
  }
}

}  // namespace

void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n, const MarchOptions& options,
                    const DeviceRenderTarget& target) {
  if (n == 0) return;
  ByBasis(grid.basis, [&](auto basis) {
    RenderRaysKernel<basis.value>
        <<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays, n, options, target);
  });
  CheckLaunch("render_rays");
}

void MaxWeightsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, float* weights) {
  if (n == 0) return;
  MaxWeightsKernel<<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays, n, options, weights);
  CheckLaunch("max_weights");
}

#else

void RenderOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&,
                    const DeviceRenderTarget&) {
  DeviceWait("render_rays");
}
void MaxWeightsOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&, float*) {
  DeviceWait("max_weights");
}

#endif

}  // namespace regrade
