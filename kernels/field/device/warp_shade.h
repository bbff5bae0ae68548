// Colours and gradients of a warp's samples: the lanes that marched now stand for the values of one
// record (basis 9), of two (basis 4) or of eight (basis 1). Device code only.
#pragma once

#include "kernels/field/device/warp_march.h"
#include "kernels/field/spherical_harmonics.h"

#if defined(__CUDACC__)

namespace regrade {

template <int kBasis>
struct WarpRecord {
  static constexpr int kLanes = RecordLanes(kBasis);
  static constexpr int kGroups = 32 / kLanes;  // records side by side

  int group, in_group;
  float gamma = 0;  // of the value that this lane stands for; 0 for density and padding

  __device__ WarpRecord(int lane, const Vec3f& direction)
      : group(lane / kLanes), in_group(lane % kLanes) {
    float basis[kMaxBasis];
    ShBasis(kBasis, direction, basis);
#pragma unroll
    for (int k = 0; k < kBasis; ++k)
      if (in_group < 3 * kBasis && in_group % kBasis == k) gamma = basis[k];
  }

  // Value c x kBasis + k in lane order; sums of a channel's kBasis lanes land on its first lane.
  __device__ static float ChannelSums(float value, int in_group) {
    if constexpr (kBasis == 9) {
      const float ninth = __shfl_down_sync(kAllLanes, value, 8);
      if (in_group % 9 == 0) value += ninth;
      value += __shfl_down_sync(kAllLanes, value, 4);
    }
    if constexpr (kBasis >= 4) {
      value += __shfl_down_sync(kAllLanes, value, 2);
      value += __shfl_down_sync(kAllLanes, value, 1);
    }
    return value;
  }
};

__device__ inline int CornerOffset(const GridFrame& frame, int corner) {
  return ((corner >> 2) & 1) * frame.resolution.y * frame.resolution.z +
         ((corner >> 1) & 1) * frame.resolution.z + (corner & 1);
}

// The colour of each compositing lane's own sample, before the clamp. See EQ(sh-basis).
template <int kBasis>
__device__ Vec3f RawColors(const DeviceGridView& grid, const WarpRecord<kBasis>& record,
                           const LaneSample& sample, unsigned composited, int lane) {
  constexpr int kLanes = WarpRecord<kBasis>::kLanes, kGroups = WarpRecord<kBasis>::kGroups;
  Vec3f raw{0.5f, 0.5f, 0.5f};
  for (unsigned left = composited; left != 0;) {
    const int first = __ffs(left) - 1;
    const int source = first + record.group;
    const int vertex = __shfl_sync(kAllLanes, sample.cell.vertex, source & 31);
    Vec3f fraction;
    fraction.x = __shfl_sync(kAllLanes, sample.cell.fraction.x, source & 31);
    fraction.y = __shfl_sync(kAllLanes, sample.cell.fraction.y, source & 31);
    fraction.z = __shfl_sync(kAllLanes, sample.cell.fraction.z, source & 31);
    float value = 0;
    if (source < 32 && (composited >> source & 1) != 0) {
      int32_t link[8];
#pragma unroll
      for (int k = 0; k < 8; ++k) link[k] = grid.links[vertex + CornerOffset(grid.frame, k)];
#pragma unroll
      for (int k = 0; k < 8; ++k)
        if (link[k] >= 0)
          value += CornerWeight(fraction, k) *
                   grid.records[static_cast<int64_t>(link[k]) * kLanes + record.in_group];
    }
    value = WarpRecord<kBasis>::ChannelSums(value * record.gamma, record.in_group);
    const int served_by = lane - first;  // the group that worked on this lane's sample
    const bool served = served_by >= 0 && served_by < kGroups;
#pragma unroll
    for (int c = 0; c < 3; ++c) {
      const float sum = __shfl_sync(kAllLanes, value, (served_by * kLanes + c * kBasis) & 31);
      if (served) raw[c] += sum;
    }
    left &= ~static_cast<unsigned>(((uint64_t{1} << kGroups) - 1) << first);
  }
  return raw;
}

}  // namespace regrade

#endif
