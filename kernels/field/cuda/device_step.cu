// Total variation and the optimizer's step on touched voxels; the lanes of a group hold the
// values of one record.
#include <algorithm>

#include "kernels/field/cuda/device_rays.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/cuda/warp_march.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

#if defined(__CUDACC__)

namespace {

// See EQ(total-variation): an empty neighbour counts as 0 for densities and as the voxel's own
// value for colours; no difference is taken across the box's border.
template <int kBasis, bool kExact>
__global__ void TotalVariationKernel(DeviceGridView grid, int64_t begin, int64_t count,
                                     float scale_density, float scale_sh,
                                     GradientView gradient) {
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
  float weighted[3], radicand = 1e-9f;
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
    radicand += weighted[a] * weighted[a];
  }
  const float scale = is_density ? scale_density : value < 3 * kBasis ? scale_sh : 0.0f;
  const float inverse = scale * rsqrtf(radicand);
  const auto add = [&](int64_t to, float d) {
    float* const row = gradient.gradient + to * grid.stride;
    if constexpr (kExact)
      AddExact(row, value, d);
    else
      atomicAdd(row + value, d);
  };
  float d_own = 0;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float d = static_cast<float>(n[a]) / 256.0f * weighted[a] * inverse;
    d_own -= d;
    if (neighbour[a] < 0) continue;
    if (d != 0) add(neighbour[a], d);
    if (value == 0) Touch(gradient.touched, neighbour[a]);
  }
  if (d_own != 0) add(voxel, d_own);
  if (value == 0) Touch(gradient.touched, static_cast<int32_t>(voxel));
}

// Update rules of a lane's four consecutive values of a record in the step kernel.
template <int kBasis>
struct StepRules {
  float rate[4], bound[4];

  __device__ StepRules(int quad, const RmspropOptions& options) {
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const int value = 4 * quad + i;
      rate[i] = value == DensityLane(kBasis) ? options.rate_density
                : value < 3 * kBasis         ? options.rate_sh
                                             : 0.0f;
      bound[i] = value >= 3 * kBasis   ? kUnbounded
                 : value % kBasis == 0 ? options.mean_bound
                                       : options.view_bound;
    }
  }
};

// A lane's values of one voxel, between loading and storing.
struct StepQuad {
  float4* at = nullptr;  // values; gradient and moment follow; null if the lane has no voxel
  float4 value, gradient, moment;
  int64_t voxel;
};

__device__ inline float Stepped(float x, float g, float moment, float rate, float bound,
                                float epsilon) {
  const float stepped = x - rate * g / (sqrtf(moment) + epsilon);
  return fminf(fmaxf(stepped, -bound), bound);
}

__device__ inline float NextMoment(float old, float g, float beta) {
  return old == 0 ? g * g : beta * old + (1 - beta) * g * g;
}

// A warp processes the 32 voxels of one word of marks. A lane holds four consecutive values,
// and kTurns sets of records are loaded at once. Lanes do not diverge: a divergent warp would
// wait for each branch's loads in turn.
template <int kBasis, bool kExact>
__global__ void StepKernel(DeviceGridView grid, uint32_t* __restrict__ touched, int64_t words,
                           RmspropOptions options, DeviceFitSums* sums) {
  constexpr int kQuads = RecordLanes(kBasis) / 4, kGroups = 32 / kQuads;
  constexpr int kTurns = kGroups >= 8 ? 1 : 2;
  const int lane = static_cast<int>(threadIdx.x & 31);
  const int quad = lane % kQuads, group = lane / kQuads;
  const unsigned group_lanes =
      kQuads == 32 ? kAllLanes : ((1u << kQuads) - 1) << (group * kQuads);
  constexpr int kMoment = (kExact ? 3 : 2) * kQuads;  // quads from a value to its moment
  const auto clear = [&](StepQuad* of) {
    if constexpr (kExact) {  // integers are twice as wide
      float4* const row = of->at - quad + kQuads;
      row[2 * quad] = row[2 * quad + 1] = make_float4(0, 0, 0, 0);
    } else {
      of->at[kQuads] = make_float4(0, 0, 0, 0);
    }
  };
  const StepRules<kBasis> rules(quad, options);
  const int64_t warps = static_cast<int64_t>(gridDim.x) * (blockDim.x / 32);
  for (int64_t w = blockIdx.x * static_cast<int64_t>(blockDim.x / 32) + threadIdx.x / 32;
       w < words; w += warps) {
    unsigned marks = touched[w];
    if (marks == 0) continue;
    __syncwarp();
    if (lane == 0) touched[w] = 0;
    while (marks != 0) {
      StepQuad q[kTurns];
#pragma unroll
      for (int i = 0; i < kTurns; ++i) {
        unsigned mine = marks;  // without the marks of the groups before this one
        for (int g = 0; g < group; ++g) mine &= mine - 1;
        for (int g = 0; g < kGroups; ++g) marks &= marks - 1;
        q[i].gradient = make_float4(0, 0, 0, 0);
        if (mine == 0) continue;
        q[i].voxel = 32 * w + __ffs(mine) - 1;
        q[i].at = reinterpret_cast<float4*>(grid.records + q[i].voxel * grid.stride) + quad;
        q[i].value = q[i].at[0];
        if constexpr (kExact) {
          const float* row = grid.records + q[i].voxel * grid.stride + 4 * kQuads;
          q[i].gradient = {ExactSum(row, 4 * quad), ExactSum(row, 4 * quad + 1),
                           ExactSum(row, 4 * quad + 2), ExactSum(row, 4 * quad + 3)};
        } else {
          q[i].gradient = q[i].at[kQuads];
        }
        q[i].moment = q[i].at[kMoment];
      }
#pragma unroll
      for (int i = 0; i < kTurns; ++i) {
        const float4 g = q[i].gradient;
        const bool finite = isfinite(g.x * g.x) && isfinite(g.y * g.y) && isfinite(g.z * g.z) &&
                            isfinite(g.w * g.w);
        // A voxel with any non-finite gradient value is not stepped.
        const bool good = (__ballot_sync(kAllLanes, finite) & group_lanes) == group_lanes;
        if (q[i].at == nullptr) continue;
        clear(&q[i]);
        if (!good) {
          if (quad == 0) atomicAdd(&sums->rejected_voxels, 1ull);
          continue;
        }
        float4 m = q[i].moment, x = q[i].value;
        m.x = NextMoment(m.x, g.x, options.beta);
        m.y = NextMoment(m.y, g.y, options.beta);
        m.z = NextMoment(m.z, g.z, options.beta);
        m.w = NextMoment(m.w, g.w, options.beta);
        x.x = Stepped(x.x, g.x, m.x, rules.rate[0], rules.bound[0], options.epsilon);
        x.y = Stepped(x.y, g.y, m.y, rules.rate[1], rules.bound[1], options.epsilon);
        x.z = Stepped(x.z, g.z, m.z, rules.rate[2], rules.bound[2], options.epsilon);
        x.w = Stepped(x.w, g.w, m.w, rules.rate[3], rules.bound[3], options.epsilon);
        q[i].at[0] = x;
        q[i].at[kMoment] = m;
        constexpr int kDensity = DensityLane(kBasis);
        if (quad == kDensity / 4)
          grid.dense_density[grid.vertex_of_voxel[q[i].voxel]] = kDensity % 4 == 0   ? x.x
                                                                 : kDensity % 4 == 1 ? x.y
                                                                 : kDensity % 4 == 2 ? x.z
                                                                                     : x.w;
      }
      __syncwarp();
    }
  }
}

}  // namespace

void AddTotalVariation(const DeviceGrid& grid, int64_t begin, int64_t count,
                       float scale_density, float scale_sh, DeviceTouched* touched) {
  REGRADE_CHECK(grid.fitting);
  if (count <= 0) return;
  ByBasis(grid.basis, grid.exact_sums, [&](auto basis, auto exact) {
    TotalVariationKernel<basis.value, exact.value>
        <<<BlocksFor(count * grid.lanes()), kThreads>>>(
            grid.view(), begin, count, scale_density, scale_sh,
            GradientView{grid.gradient(), touched->bits.data()});
  });
  CheckLaunch("total_variation");
}

void StepOnDevice(DeviceGrid* grid, DeviceTouched* touched, const RmspropOptions& options,
                  DeviceFitSums* sums) {
  REGRADE_CHECK(grid->fitting);
  const int64_t words = grid->first_texel() / 32;
  ByBasis(grid->basis, grid->exact_sums, [&](auto basis, auto exact) {
    StepKernel<basis.value, exact.value>
        <<<std::min(BlocksFor(32 * words), 1u << 16), kThreads>>>(
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
