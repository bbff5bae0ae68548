#include "kernels/field/cuda/device_sphere_rays.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_adjoint_scan.h"
#include "kernels/field/cuda/warp_layers.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// One warp per ray.
__global__ void SphereRadianceKernel(DeviceGridView grid, const Ray* rays, int64_t n,
                                     float stop, Vec3f* behind) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  WarpLayers layers(grid, rays[r], 1.0f, stop);
  LaneLayer mine;
  unsigned composited;
  Vec3f color{};
  while (layers.Next(&mine, &composited))
    if (mine.tau > 0) color += mine.Color() * mine.Weight();
  for (int c = 0; c < 3; ++c) color[c] = WarpSum(color[c]);
  if (layers.lane() == 0) behind[r] = color + grid.background * layers.transmittance();
}

__device__ inline float Reversed(float value) { return __shfl_xor_sync(kAllLanes, value, 31); }
__device__ inline Vec3f Reversed(const Vec3f& v) {
  return {Reversed(v.x), Reversed(v.y), Reversed(v.z)};
}

// Adds a layer's gradient to the four texels around the crossing.
template <bool kExact>
__device__ void ScatterLayer(const DeviceSpheresView& spheres, const LaneLayer& layer,
                             const float4& d_value, const GradientView& gradient) {
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    const int32_t column = spheres.links[layer.cell.texel[k]];
    if (column < 0) continue;
    const int32_t texel = column * spheres.layers + layer.layer;
    const float w = layer.cell.weight[k];
    AddTexel<kExact>(gradient, texel,
                     {w * d_value.x, w * d_value.y, w * d_value.z, w * d_value.w});
  }
}

template <bool kExact>
__global__ void SphereRadianceAdjointKernel(DeviceGridView grid, const Ray* rays,
                                            const Vec3f* d_behind, int64_t n, float stop,
                                            GradientView gradient, DeviceFitSums* sums) {
  const int64_t r = (blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x) / 32;
  if (r >= n) return;
  const Vec3f d = d_behind[r];
  if (d.x == 0 && d.y == 0 && d.z == 0) return;
  WarpLayers layers(grid, rays[r], 1.0f, stop);
  const int lane = layers.lane();
  LaneLayer mine;
  unsigned composited;
  // Forward: lane i stores the optical depth before the i-th 32 layers.
  static_assert(kMaxLayers <= 32 * 32);
  float depth_before = 0, depth = 0;
  int blocks = 0, samples = 0;
  for (; 32 * blocks < grid.spheres.layers && layers.is_ray(); ++blocks) {
    if (lane == blocks) depth_before = depth;
    if (!(expf(-depth) >= stop)) break;
    layers.Evaluate(32 * blocks, &depth, &composited);
    samples += __popc(composited);
  }
  Vec3f behind = grid.background;
  for (int i = blocks - 1; i >= 0; --i) {
    float before = __shfl_sync(kAllLanes, depth_before, i);
    mine = layers.Evaluate(32 * i, &before, &composited);
    if (composited == 0) continue;
    const Vec3f color = mine.tau > 0 ? mine.Color() : Vec3f{};
    const float a = expf(-mine.tau);
    const Vec3f radiance_behind = Reversed(
        BackgroundRadiance(Reversed(a), Reversed(color * Opacity(mine.tau)), lane, &behind));
    if (!(mine.tau > 0)) continue;
    const float w = mine.Weight() * static_cast<float>(kSh0);
    float d_sigma =
        layers.delta() * mine.transmittance_before * a * Dot(color - radiance_behind, d);
    if (!(mine.value.w < static_cast<float>(kMaxDensity)) ||
        !(mine.value.w * layers.delta() < static_cast<float>(kMaxOpticalDepth)))
      d_sigma = 0;
    ScatterLayer<kExact>(grid.spheres, mine,
                         {color.x > 0 ? w * d.x : 0.0f, color.y > 0 ? w * d.y : 0.0f,
                          color.z > 0 ? w * d.z : 0.0f, d_sigma},
                         gradient);
  }
  if (lane == 0 && samples > 0)
    atomicAdd(&sums->samples, static_cast<unsigned long long>(samples));
}

}  // namespace

void SphereRadiance(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, Vec3f* behind) {
  if (n == 0) return;
  SphereRadianceKernel<<<BlocksFor(32 * n), kThreads>>>(grid.view(), rays, n,
                                                        options.stop_transmittance, behind);
  CheckLaunch("sphere_radiance");
}

void SphereRadianceAdjoint(const DeviceGrid& grid, const Ray* rays, const Vec3f* d_behind,
                           int64_t n, const MarchOptions& options, DeviceTouched* touched,
                           DeviceFitSums* sums) {
  REGRADE_CHECK(grid.fitting);
  if (n == 0) return;
  const GradientView gradient = TexelGradient(grid, touched);
  if (grid.exact_sums)
    SphereRadianceAdjointKernel<true><<<BlocksFor(32 * n), kThreads>>>(
        grid.view(), rays, d_behind, n, options.stop_transmittance, gradient, sums);
  else
    SphereRadianceAdjointKernel<false><<<BlocksFor(32 * n), kThreads>>>(
        grid.view(), rays, d_behind, n, options.stop_transmittance, gradient, sums);
  CheckLaunch("sphere_radiance_adjoint");
}

#else

void SphereRadiance(const DeviceGrid&, const Ray*, int64_t, const MarchOptions&, Vec3f*) {
  DeviceWait("sphere_radiance");
}
void SphereRadianceAdjoint(const DeviceGrid&, const Ray*, const Vec3f*, int64_t,
                           const MarchOptions&, DeviceTouched*, DeviceFitSums*) {
  DeviceWait("sphere_radiance_adjoint");
}

#endif

}  // namespace regrade
