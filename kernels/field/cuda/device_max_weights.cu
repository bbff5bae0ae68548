// The largest weight that any ray gives a voxel, the criterion for pruning.
#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_march.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// Positive floats are ordered like their bits.
__device__ void RaiseTo(float* target, float value) {
  if (*target < value) atomicMax(reinterpret_cast<int*>(target), __float_as_int(value));
}

__global__ void MaxWeightsKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                 MarchOptions options, float* weights) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  WarpMarch<> march(grid, rays[r], options);
  LaneSample sample;
  unsigned composited;
  while (march.Next(&sample, &composited)) {
    if (!(sample.tau > 0)) continue;
    const float w = sample.transmittance_before * Opacity(sample.tau);
    const NeighbourSteps steps = GridSampler(grid).Steps(sample.cell.vertex);
    for (int k = 0; k < 8; ++k) {
      const int32_t link = grid.links[sample.cell.vertex + steps.To(k)];
      if (link >= 0) RaiseTo(&weights[link], w);
    }
  }
}

}  // namespace

void MaxWeightsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, float* weights) {
  if (n == 0) return;
  MaxWeightsKernel<<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays, n, options, weights);
  CheckLaunch("max_weights");
}

#else

void MaxWeightsOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&, float*) {
  DeviceWait("max_weights");
}

#endif

}  // namespace regrade
