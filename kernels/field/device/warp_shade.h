// Colours and gradients of a warp's samples: the lanes that marched now stand for the values of
// one record (basis 9), of two (basis 4) or of eight (basis 1). Device code only.
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

  // Value c x kBasis + k in lane order; sums of a channel's kBasis lanes land on its first
  // lane.
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

// Four samples are worked on at a time: lane 8 j + k knows corner k of the j-th. Loads of many
// records are in flight at once, which is what a single ray's latency asks for.
inline constexpr int kTurn = 4;

struct TurnCorner {
  int source;    // the lane whose sample this is; -1 past the last
  int32_t link;  // -1 where nothing is stored
  float weight;

  __device__ TurnCorner(const DeviceGridView& grid, int vertex, const Vec3f& fraction, int from,
                        int lane)
      : source(from), link(-1), weight(0) {
    if (from < 0) return;
    link = grid.links[vertex + CornerOffset(grid.frame, lane & 7)];
    weight = CornerWeight(fraction, lane & 7);
  }
};

// The lane that holds the j-th lowest set bit of `left`, or -1.
__device__ inline int NthLane(unsigned left, int j) {
  for (; j > 0 && left != 0; --j) left &= left - 1;
  return left == 0 ? -1 : __ffs(left) - 1;
}

// The colour of each compositing lane's own sample, before the clamp. See EQ(sh-basis).
template <int kBasis>
__device__ Vec3f RawColors(const DeviceGridView& grid, const WarpRecord<kBasis>& record,
                           const LaneSample& sample, unsigned composited, int lane) {
  constexpr int kLanes = WarpRecord<kBasis>::kLanes, kGroups = WarpRecord<kBasis>::kGroups;
  constexpr int kSums = kGroups < kTurn ? kTurn / kGroups : 1;  // samples that a group works on
  Vec3f raw{0.5f, 0.5f, 0.5f};
  for (unsigned left = composited; left != 0;) {
    const int source = NthLane(left, lane >> 3);
    const int from = source & 31;
    const int vertex = __shfl_sync(kAllLanes, sample.cell.vertex, from);
    const Vec3f fraction{__shfl_sync(kAllLanes, sample.cell.fraction.x, from),
                         __shfl_sync(kAllLanes, sample.cell.fraction.y, from),
                         __shfl_sync(kAllLanes, sample.cell.fraction.z, from)};
    const TurnCorner corner(grid, vertex, fraction, source, lane);
    float value[kSums] = {};
#pragma unroll
    for (int i = 0; i < kSums; ++i) {
      const int j = (record.group + kGroups * i) & (kTurn - 1);
#pragma unroll
      for (int k = 0; k < 8; ++k) {
        const int32_t link = __shfl_sync(kAllLanes, corner.link, 8 * j + k);
        const float weight = __shfl_sync(kAllLanes, corner.weight, 8 * j + k);
        if (link >= 0) value[i] += weight * grid.records[link * grid.stride + record.in_group];
      }
    }
#pragma unroll
    for (int i = 0; i < kSums; ++i)
      value[i] = WarpRecord<kBasis>::ChannelSums(value[i] * record.gamma, record.in_group);
#pragma unroll
    for (int j = 0; j < kTurn; ++j) {
      const int owner = __shfl_sync(kAllLanes, corner.source, 8 * j);
#pragma unroll
      for (int c = 0; c < 3; ++c) {
        const float sum = __shfl_sync(kAllLanes, value[j / kGroups % kSums],
                                      j % kGroups * kLanes + c * kBasis);
        if (lane == owner) raw[c] += sum;
      }
    }
    for (int j = 0; j < kTurn; ++j) left &= left - 1;
  }
  return raw;
}

}  // namespace regrade

#endif
