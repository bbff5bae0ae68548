// Total variation and the optimizer's step on touched voxels; the lanes of a group stand for the values of
// one record.
#include <algorithm>

#include "kernels/field/device/device_rays.h"
#include "kernels/field/device/gradient_view.h"
#include "kernels/field/device/launch.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// See EQ(total-variation): an empty neighbour counts as 0 for densities and as the voxel's own value for
// colours; beyond the box nothing is compared.
template <int kBasis>
__global__ void TotalVariationKernel(DeviceGridView grid, int64_t begin, int64_t count,
                                     float scale_density, float scale_sh, GradientView gradient) {
  constexpr int kLanes = RecordLanes(kBasis);
  const int64_t thread = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (thread / kLanes >= count) return;
  const int value = static_cast<int>(thread % kLanes);
  const int64_t voxel = (begin + thread / kLanes) % grid.num_voxels;
  const Vec3i n = grid.frame.resolution;
  const int32_t vertex = grid.vertex_of_voxel[voxel];
  const int strides[3] = {n.y * n.z, n.z, 1};
  const int at[3] = {vertex / strides[0], vertex / strides[1] % n.y, vertex % n.z};
  const bool is_density = value == DensityLane(kBasis);
  const float own = grid.records[voxel * grid.stride + value];
  int32_t neighbour[3];
  float weighted[3], inside = 1e-9f;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const bool in_box = at[a] + 1 < n[a];
    neighbour[a] = in_box ? grid.links[vertex + strides[a]] : -1;
    float other = own;
    if (neighbour[a] >= 0)
      other = grid.records[neighbour[a] * grid.stride + value];
    else if (in_box && is_density)
      other = 0;
    weighted[a] = static_cast<float>(n[a]) / 256.0f * (other - own);
    inside += weighted[a] * weighted[a];
  }
  const float scale = is_density ? scale_density : value < 3 * kBasis ? scale_sh : 0.0f;
  const float inverse = scale * rsqrtf(inside);
  float d_own = 0;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float d = static_cast<float>(n[a]) / 256.0f * weighted[a] * inverse;
    d_own -= d;
    if (neighbour[a] < 0) continue;
    if (d != 0) atomicAdd(&gradient.gradient[neighbour[a] * grid.stride + value], d);
    if (value == 0) Touch(gradient.touched, neighbour[a]);
  }
  if (d_own != 0) atomicAdd(&gradient.gradient[voxel * grid.stride + value], d_own);
  if (value == 0) Touch(gradient.touched, static_cast<int32_t>(voxel));
}

// A warp takes the 32 voxels of one word of marks; its lanes are the values of one record (basis 9), or of
// two or eight.
template <int kBasis>
__global__ void StepKernel(DeviceGridView grid, uint32_t* __restrict__ touched, int64_t words, RmspropOptions options, DeviceFitSums* sums) {
  constexpr int kLanes = RecordLanes(kBasis), kGroups = 32 / kLanes;
  constexpr float kMeanBound = static_cast<float>(0.5 / kSh0);  // 1/2 + kSh0 sh_0 in [0, 1]
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int value = lane % kLanes, group = lane / kLanes;
  const unsigned group_lanes = kLanes == 32 ? 0xffffffffu : ((1u << kLanes) - 1) << (group * kLanes);
  const bool is_density = value == DensityLane(kBasis);
  const float rate = is_density ? options.rate_density : value < 3 * kBasis ? options.rate_sh : 0.0f;
  const float bound = value >= 3 * kBasis   ? 3e38f
                      : value % kBasis == 0 ? kMeanBound
                                            : options.view_bound;
  const int64_t warps = static_cast<int64_t>(gridDim.x) * (blockDim.x / 32);
  for (int64_t w = blockIdx.x * static_cast<int64_t>(blockDim.x / 32) + threadIdx.x / 32; w < words;
       w += warps) {
    unsigned marks = touched[w];
    if (marks == 0) continue;
    if (lane == 0) touched[w] = 0;
    for (; marks != 0; ) {
      unsigned mine = marks;  // with the marks of the groups before this one taken away
      for (int g = 0; g < group; ++g) mine &= mine - 1;
      for (int g = 0; g < kGroups; ++g) marks &= marks - 1;
      if (mine == 0) continue;
      const int64_t voxel = 32 * w + __ffs(mine) - 1;
      float* at = grid.records + voxel * grid.stride + value;  // values, gradient, moment
      const float x = at[0], g = at[kLanes], old = at[2 * kLanes];
      at[kLanes] = 0;
      // A voxel of whose gradient any part is not finite stays as it is.
      if (!__all_sync(group_lanes, isfinite(g * g))) {
        if (value == 0) atomicAdd(&sums->rejected_voxels, 1ull);
        continue;
      }
      const float moment = old == 0 ? g * g : options.beta * old + (1 - options.beta) * g * g;
      at[2 * kLanes] = moment;
      const float stepped = x - rate * g / (sqrtf(moment) + options.epsilon);
      const float bounded = fminf(fmaxf(stepped, -bound), bound);
      at[0] = bounded;
      if (is_density) grid.dense_density[grid.vertex_of_voxel[voxel]] = bounded;
    }
  }
}

}  // namespace

void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count, float scale_density,
                       float scale_sh, DeviceTouched* touched) {
  REGRADE_CHECK(grid.fitting);
  if (count <= 0) return;
  ByBasis(grid.basis, [&](auto basis) {
    TotalVariationKernel<basis.value><<<BlocksFor(count * grid.lanes()), kThreads>>>(
        grid.view(), begin, count, scale_density, scale_sh,
        GradientView{grid.gradient(), touched->bits.data()});
  });
  CheckLaunch("total_variation");
}

void StepOnDevice(DeviceGrid* grid, DeviceTouched* touched, const RmspropOptions& options,
                  DeviceFitSums* sums) {
  REGRADE_CHECK(grid->fitting);
  const int64_t words = touched->bits.size();
  ByBasis(grid->basis, [&](auto basis) {
    StepKernel<basis.value><<<std::min(BlocksFor(32 * words), 1u << 16), kThreads>>>(
        grid->view(), touched->bits.data(), words, options, sums);
  });
  CheckLaunch("step");
}

#else

void AddTotalVariation(const DeviceGrid&, int64_t, int64_t, float, float, DeviceTouched*) {
  DeviceWait("total_variation");
}
void StepOnDevice(DeviceGrid*, DeviceTouched*, const RmspropOptions&, DeviceFitSums*) {
  DeviceWait("step");
}

#endif

}  // namespace regrade
