// Total variation of the background's layers and the optimizer's step on their touched texels.
#include <algorithm>

#include "kernels/field/cuda/device_sphere_rays.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/total_variation.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// One thread per texel of a layer; see SphereVariation.
template <bool kExact>
__global__ void SphereVariationKernel(DeviceSpheresView spheres, int64_t begin, int64_t count,
                                      float scale_density, float scale_color,
                                      GradientView gradient) {
  const int64_t thread = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (thread / spheres.layers >= count) return;
  const int layer = static_cast<int>(thread % spheres.layers), r = spheres.resolution;
  const int64_t map = int64_t{2} * r * r, at = (begin + thread / spheres.layers) % map;
  const int32_t column = spheres.links[at];
  if (column < 0) return;
  const int32_t east = spheres.links[(at + r) % map];
  const int32_t south = at % r + 1 < r ? spheres.links[at + 1] : -1;
  const int32_t own = column * spheres.layers + layer;
  const int32_t next[3] = {east >= 0 ? east * spheres.layers + layer : own,
                           south >= 0 ? south * spheres.layers + layer : own,
                           layer + 1 < spheres.layers ? own + 1 : own};
  float difference[3][4], d[3][4] = {}, d_own[4] = {};
#pragma unroll
  for (int v = 0; v < 4; ++v) {
    const float value = spheres.texels[int64_t{own} * 4 + v];
    float radicand = static_cast<float>(kVariationEpsilon);
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      difference[a][v] = spheres.texels[int64_t{next[a]} * 4 + v] - value;
      radicand += difference[a][v] * difference[a][v];
    }
    const float scale = (v == 3 ? scale_density : scale_color) / sqrtf(radicand);
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      if (next[a] != own) d[a][v] = scale * difference[a][v];
      d_own[v] -= d[a][v];
    }
  }
  const auto add = [&](int32_t texel, const float(&v)[4]) {
    if (v[0] != 0 || v[1] != 0 || v[2] != 0 || v[3] != 0)  // true for NaN, too
      AddTexel<kExact>(gradient, texel, {v[0], v[1], v[2], v[3]});
  };
  for (int a = 0; a < 3; ++a) add(next[a], d[a]);
  add(own, d_own);
}

// One lane per texel of one word of marks. See StepSpheres.
template <bool kExact>
__global__ void StepSpheresKernel(DeviceSpheresView spheres, float* gradient,
                                  float* second_moment, uint32_t* __restrict__ touched,
                                  int64_t words, RmspropOptions options, DeviceFitSums* sums) {
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int64_t warps = static_cast<int64_t>(gridDim.x) * (blockDim.x / 32);
  for (int64_t w = blockIdx.x * static_cast<int64_t>(blockDim.x / 32) + threadIdx.x / 32;
       w < words; w += warps) {
    const uint32_t marks = touched[w];
    if (marks == 0) continue;
    __syncwarp();
    if (lane == 0) touched[w] = 0;
    if ((marks >> lane & 1) == 0) continue;
    const int64_t texel = 32 * w + lane;
    float g[4];
    bool finite = true;
    for (int c = 0; c < 4; ++c) {
      if constexpr (kExact) {
        float* const row = gradient + 8 * texel;
        g[c] = ExactSum(row, c);
        row[2 * c] = row[2 * c + 1] = 0;
      } else {
        g[c] = gradient[4 * texel + c];
        gradient[4 * texel + c] = 0;
      }
      finite = finite && isfinite(g[c] * g[c]);
    }
    if (!finite) {
      atomicAdd(&sums->rejected_voxels, 1ull);
      continue;
    }
    float4* const x = reinterpret_cast<float4*>(spheres.texels) + texel;
    float4* const v = reinterpret_cast<float4*>(second_moment) + texel;
    const float4 old_x = *x, old_v = *v;
    float value[4] = {old_x.x, old_x.y, old_x.z, old_x.w};
    float moment[4] = {old_v.x, old_v.y, old_v.z, old_v.w};
#pragma unroll
    for (int c = 0; c < 4; ++c) {
      const float squared = g[c] * g[c];
      moment[c] =
          moment[c] == 0 ? squared : options.beta * moment[c] + (1 - options.beta) * squared;
      const float rate = c == 3 ? options.rate_sphere_density : options.rate_sphere_color;
      value[c] -= rate * g[c] / (sqrtf(moment[c]) + options.epsilon);
      if (c < 3) value[c] = fminf(fmaxf(value[c], -options.mean_bound), options.mean_bound);
    }
    *x = {value[0], value[1], value[2], value[3]};
    *v = {moment[0], moment[1], moment[2], moment[3]};
  }
}

}  // namespace

void AddSphereVariation(const DeviceGrid& grid, int64_t begin, int64_t count,
                        float scale_density, float scale_color, DeviceTouched* touched) {
  REGRADE_CHECK(grid.fitting);
  if (count <= 0) return;
  const unsigned blocks = BlocksFor(count * grid.spheres.layers);
  const GradientView gradient = TexelGradient(grid, touched);
  if (grid.exact_sums)
    SphereVariationKernel<true><<<blocks, kThreads>>>(grid.spheres.view(), begin, count,
                                                      scale_density, scale_color, gradient);
  else
    SphereVariationKernel<false><<<blocks, kThreads>>>(grid.spheres.view(), begin, count,
                                                       scale_density, scale_color, gradient);
  CheckLaunch("sphere_variation");
}

void StepSpheresOnDevice(DeviceGrid* grid, DeviceTouched* touched,
                         const RmspropOptions& options, DeviceFitSums* sums) {
  REGRADE_CHECK(grid->fitting);
  DeviceSpheres& spheres = grid->spheres;
  const GradientView gradient = TexelGradient(*grid, touched);
  const int64_t words = (spheres.num_texels() + 31) / 32;
  const unsigned blocks = std::min(BlocksFor(32 * words), 1u << 16);
  if (grid->exact_sums)
    StepSpheresKernel<true><<<blocks, kThreads>>>(spheres.view(), gradient.gradient,
                                                  spheres.second_moment.data(),
                                                  gradient.touched, words, options, sums);
  else
    StepSpheresKernel<false><<<blocks, kThreads>>>(spheres.view(), gradient.gradient,
                                                   spheres.second_moment.data(),
                                                   gradient.touched, words, options, sums);
  CheckLaunch("step_spheres");
}

#else

void AddSphereVariation(const DeviceGrid&, int64_t, int64_t, float, float, DeviceTouched*) {
  DeviceWait("sphere_variation");
}
void StepSpheresOnDevice(DeviceGrid*, DeviceTouched*, const RmspropOptions&, DeviceFitSums*) {
  DeviceWait("step_spheres");
}

#endif

}  // namespace regrade
