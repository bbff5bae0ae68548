// Rendering and the largest weights of voxels, a warp a ray.
#include <vector>

#include "kernels/field/device/device_rays.h"
#include "kernels/field/device/launch.h"
#include "kernels/field/device/warp_shade.h"

namespace regrade {

RenderedView RenderViewOnDevice(const DeviceGrid& grid, const Camera& camera,
                                const MarchOptions& options, float opacity_step) {
  const int64_t n = int64_t{camera.width} * camera.height;
  std::vector<Ray> rays(static_cast<size_t>(n));
#pragma omp parallel for schedule(static)
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      rays[static_cast<size_t>(y) * camera.width + x] = camera.PixelRay(x, y);
  DeviceBuffer<Ray> device_rays(n, "rays of a view");
  device_rays.CopyIn(rays.data(), n);
  DeviceBuffer<Vec3f> color(n, "colours of a view");
  DeviceBuffer<float> depth(n, "depths of a view"),
      transmittance(n, "transmittances of a view");
  RenderOnDevice(grid, device_rays.data(), n, options,
                 {color.data(), depth.data(), transmittance.data()}, opacity_step);
  RenderedView view{Image(camera.width, camera.height, 3),
                    Image(camera.width, camera.height, 1),
                    Image(camera.width, camera.height, 1)};
  DeviceCopyOut(view.color.pixels.data(), color.data(), n * int64_t{sizeof(Vec3f)});
  depth.CopyOut(view.depth.pixels.data(), n);
  transmittance.CopyOut(view.transmittance.pixels.data(), n);
  FinishView(camera, rays, &view);
  return view;
}

#if defined(__CUDACC__)

namespace {

// Which lanes' colours are looked at, and what each of them weighs; see EQ(opacity-steps).
class OpacitySteps {
 public:
  __device__ explicit OpacitySteps(float step) : inverse_(step > 0 ? 1 / step : 0) {}

  // `before` and `after`: transmittances around a compositing lane's sample. Lanes that are
  // looked at get a weight above 0.
  __device__ unsigned Choose(bool composites, float before, float after, int lane,
                             float* weight) {
    const bool chosen =
        composites && (inverse_ == 0 || floorf((1 - after) * inverse_ + 0.5f) >
                                            floorf((1 - before) * inverse_ + 0.5f));
    const unsigned all = __ballot_sync(kAllLanes, chosen);
    const unsigned earlier = all & ((1u << lane) - 1);
    const float last_of_batch =
        __shfl_sync(kAllLanes, after, earlier == 0 ? 0 : 31 - __clz(earlier));
    *weight = chosen ? (earlier == 0 ? seen_ : last_of_batch) - after : 0.0f;
    if (all != 0) seen_ = __shfl_sync(kAllLanes, after, 31 - __clz(all));
    return all;
  }
  // What the sum of the weights lacks at the ray's end, where `left` of the light is left.
  __device__ float Scale(float left) const {
    return seen_ < 1 ? (1 - left) / (1 - seen_) : 1.0f;
  }

 private:
  float inverse_;
  float seen_ = 1;  // transmittance behind the last sample that was looked at
};

template <int kBasis>
__global__ void RenderRaysKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                 MarchOptions options, float opacity_step,
                                 DeviceRenderTarget target) {
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
  OpacitySteps steps(opacity_step);
  while (march.Next(&sample, &composited)) {
    const float alpha = sample.tau > 0 ? Opacity(sample.tau) : 0.0f;
    const float w = sample.transmittance_before * alpha;
    depth += w * sample.t;
    float seen;
    const unsigned chosen = steps.Choose(sample.tau > 0, sample.transmittance_before,
                                         sample.transmittance_before - w, lane, &seen);
    if (chosen == 0) continue;
    const Vec3f raw = RawColors<kBasis>(grid, record, sample, chosen, lane);
    const float weight = opacity_step > 0 ? seen : w;
    for (int c = 0; c < 3; ++c) color[c] += weight * fmaxf(raw[c], 0.0f);
  }
  const float left = expf(-march.optical_depth());
  const float scale = opacity_step > 0 ? steps.Scale(left) : 1.0f;
  for (int c = 0; c < 3; ++c) color[c] = scale * WarpSum(color[c]) + grid.background[c] * left;
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

void RenderOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target,
                    float opacity_step) {
  if (n == 0) return;
  ByBasis(grid.basis, [&](auto basis) {
    RenderRaysKernel<basis.value>
        <<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays, n, options, opacity_step, target);
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
                    const DeviceRenderTarget&, float) {
  DeviceWait("render_rays");
}
void MaxWeightsOnDevice(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&, float*) {
  DeviceWait("max_weights");
}

#endif

}  // namespace regrade
