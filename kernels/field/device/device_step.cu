// Total variation and the optimizer's step on touched voxels; the lanes of a group stand for the values of
// one record.
#include "kernels/field/device/device_rays.h"
#include "kernels/field/device/launch.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// See EQ(total-variation): an empty neighbour counts as 0 for densities and as the voxel's own value for
// colours; beyond the box nothing is compared.
template <int kBasis>
__global__ void TotalVariationKernel(DeviceGridView grid, int64_t begin, int64_t count,
                                     float scale_density, float scale_sh, float* gradient,
                                     int32_t* touched, int32_t* list, int32_t* list_count) {
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
  const float own = grid.records[voxel * kLanes + value];
  int32_t neighbour[3];
  float weighted[3], inside = 1e-9f;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const bool in_box = at[a] + 1 < n[a];
    neighbour[a] = in_box ? grid.links[vertex + strides[a]] : -1;
    float other = own;
    if (neighbour[a] >= 0)
      other = grid.records[static_cast<int64_t>(neighbour[a]) * kLanes + value];
    else if (in_box && is_density)
      other = 0;
    weighted[a] = static_cast<float>(n[a]) / 256.0f * (other - own);
    inside += weighted[a] * weighted[a];
  }
  const float scale = is_density ? scale_density : value < 3 * kBasis ? scale_sh : 0.0f;
  const float inverse = scale * rsqrtf(inside);
  const auto touch = [&](int32_t v) {
    if (touched[v] == 0 && atomicExch(&touched[v], 1) == 0) list[atomicAdd(list_count, 1)] = v;
  };
  float d_own = 0;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float d = static_cast<float>(n[a]) / 256.0f * weighted[a] * inverse;
    d_own -= d;
    if (neighbour[a] < 0) continue;
    if (d != 0) atomicAdd(&gradient[static_cast<int64_t>(neighbour[a]) * kLanes + value], d);
    if (value == 0) touch(neighbour[a]);
  }
  if (d_own != 0) atomicAdd(&gradient[voxel * kLanes + value], d_own);
  if (value == 0) touch(static_cast<int32_t>(voxel));
}

template <int kBasis>
__global__ void StepKernel(DeviceGridView grid, float* second_moment, float* gradient,
                           int32_t* touched, const int32_t* list, const int32_t* list_count,
                           RmspropOptions options, DeviceFitSums* sums) {
  constexpr int kLanes = RecordLanes(kBasis);
  constexpr float kMeanBound = static_cast<float>(0.5 / kSh0);  // 1/2 + kSh0 sh_0 in [0, 1]
  const int64_t threads = static_cast<int64_t>(gridDim.x) * blockDim.x;
  const int64_t first = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int value = static_cast<int>(first % kLanes);
  const unsigned group = kLanes == 32 ? 0xffffffffu
                                      : ((1u << kLanes) - 1) << ((threadIdx.x & 31) / kLanes * kLanes);
  const bool is_density = value == DensityLane(kBasis);
  const float rate = is_density ? options.rate_density : value < 3 * kBasis ? options.rate_sh : 0.0f;
  const float bound = value >= 3 * kBasis   ? 3e38f
                      : value % kBasis == 0 ? kMeanBound
                                            : options.view_bound;
  for (int64_t i = first / kLanes; i < *list_count; i += threads / kLanes) {
    const int32_t voxel = list[i];
    const int64_t index = static_cast<int64_t>(voxel) * kLanes + value;
    const float g = gradient[index];
    gradient[index] = 0;
    if (value == 0) touched[voxel] = 0;
    // A voxel of whose gradient any part is not finite stays as it is.
    if (!__all_sync(group, isfinite(g * g))) {
      if (value == 0) atomicAdd(&sums->rejected_voxels, 1ull);
      continue;
    }
    const float old = second_moment[index];
    const float moment = old == 0 ? g * g : options.beta * old + (1 - options.beta) * g * g;
    second_moment[index] = moment;
    const float stepped = grid.records[index] - rate * g / (sqrtf(moment) + options.epsilon);
    const float bounded = fminf(fmaxf(stepped, -bound), bound);
    grid.records[index] = bounded;
    if (is_density) grid.dense_density[grid.vertex_of_voxel[voxel]] = bounded;
  }
}

}  // namespace

void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count, float scale_density,
                       float scale_sh, DeviceGradient* gradient) {
  if (count <= 0) return;
  ByBasis(grid.basis, [&](auto basis) {
    TotalVariationKernel<basis.value><<<BlocksFor(count * grid.lanes()), kThreads>>>(
        grid.view(), begin, count, scale_density, scale_sh, gradient->gradient.data(),
        gradient->touched.data(), gradient->list.data(), gradient->count.data());
  });
  CheckLaunch("total_variation");
}

void StepOnDevice(DeviceGrid* grid, float* second_moment, DeviceGradient* gradient,
                  const RmspropOptions& options, DeviceFitSums* sums) {
  ByBasis(grid->basis, [&](auto basis) {
    StepKernel<basis.value><<<132 * 8, kThreads>>>(grid->view(), second_moment,
                                                   gradient->gradient.data(),
                                                   gradient->touched.data(), gradient->list.data(),
                                                   gradient->count.data(), options, sums);
  });
  CheckLaunch("step");
  gradient->count.Zero();
}

#else

void AddTotalVariation(const DeviceGrid&, int64_t, int64_t, float, float, DeviceGradient*) {
  DeviceWait("total_variation");
}
void StepOnDevice(DeviceGrid*, float*, DeviceGradient*, const RmspropOptions&, DeviceFitSums*) {
  DeviceWait("step");
}

#endif

}  // namespace regrade
