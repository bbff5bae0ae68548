// Colours and gradients of samples, one group of lanes per sample: a lane reads 16 bytes of
// each of the eight corners' records, so that one instruction loads several whole records and a
// sum over a group needs few shuffles. Device code only.
#pragma once

#include "kernels/field/cuda/warp_march.h"
#include "kernels/field/spherical_harmonics.h"

#if defined(__CUDACC__)

namespace regrade {

// Assigns the values of a record to lanes: kValues consecutive ones each.
template <int kBasis>
struct RecordLayout {
  static constexpr int kValues = 4;
  static constexpr int kGroup = RecordLanes(kBasis) / kValues;  // lanes per record: 8, 4 or 1
  static constexpr int kSamples = 32 / kGroup;                  // concurrent samples of a warp
};

// The meaning, for one ray, of a lane's values of a record: basis functions of the three
// channels, and which value is the density.
template <int kBasis>
struct LaneValues {
  using Layout = RecordLayout<kBasis>;
  float of[3][Layout::kValues] = {};
  float density[Layout::kValues] = {};

  __device__ LaneValues(int lane, const float (&basis)[kMaxVoxelBasis]) {
#pragma unroll
    for (int index = 0; index <= DensityLane(kBasis); ++index) {
      if (index / Layout::kValues != lane % Layout::kGroup) continue;
      if (index == DensityLane(kBasis))
        density[index % Layout::kValues] = 1;
      else
        of[index / kBasis][index % Layout::kValues] = basis[index % kBasis];
    }
  }
};

// The links of the corners of a group's sample; each lane of the group loads some of them.
template <int kGroup>
class GroupLinks {
 public:
  template <typename Sampler>
  __device__ GroupLinks(const Sampler& sampler, int vertex, bool valid, int lane) {
    const NeighbourSteps steps = sampler.Steps(vertex);
#pragma unroll
    for (int i = 0; i < kOwn; ++i)
      own_[i] = valid ? sampler.Link(vertex + steps.To(lane % kGroup + kGroup * i)) : -1;
  }
  __device__ int32_t Of(int corner) const {
    return __shfl_sync(kAllLanes, own_[corner / kGroup], corner % kGroup, kGroup);
  }
  // Calls body(link) for the stored corners, each in one lane.
  template <typename Body>
  __device__ void ForEachOwn(const Body& body) const {
#pragma unroll
    for (int i = 0; i < kOwn; ++i)
      if (own_[i] >= 0) body(own_[i]);
  }

 private:
  static constexpr int kOwn = 8 / kGroup;
  int32_t own_[kOwn];
};

__device__ inline float4 LoadQuad(const float* from) {
  return *reinterpret_cast<const float4*>(from);
}

// The colour, before the clamp, of the sample of the lane's group. All lanes of the warp take
// part; the lanes of a group have the same sample and get the same colour. See EQ(sh-basis).
template <int kBasis>
__device__ Vec3f RawColor(const DeviceGridView& grid, const LaneValues<kBasis>& values,
                          int vertex, const Vec3f& fraction, bool valid, int lane) {
  using Layout = RecordLayout<kBasis>;
  const GroupLinks<Layout::kGroup> links(GridSampler(grid), vertex, valid, lane);
  const float* mine = grid.records + lane % Layout::kGroup * Layout::kValues;
  float4 corner[8];  // all loads are issued before the first is used
#pragma unroll
  for (int k = 0; k < 8; ++k) {
    const int32_t link = links.Of(k);
    corner[k] = link < 0 ? float4{} : LoadQuad(mine + link * grid.stride);
  }
  float4 sum{};
#pragma unroll
  for (int k = 0; k < 8; ++k) {
    const float weight = CornerWeight(fraction, k);
    sum.x += weight * corner[k].x;
    sum.y += weight * corner[k].y;
    sum.z += weight * corner[k].z;
    sum.w += weight * corner[k].w;
  }
  Vec3f raw;
#pragma unroll
  for (int c = 0; c < 3; ++c) {
    raw[c] = values.of[c][0] * sum.x + values.of[c][1] * sum.y + values.of[c][2] * sum.z +
             values.of[c][3] * sum.w;
#pragma unroll
    for (int d = Layout::kGroup / 2; d > 0; d /= 2)
      raw[c] += __shfl_xor_sync(kAllLanes, raw[c], d);
    raw[c] += 0.5f;
  }
  return raw;
}

}  // namespace regrade

#endif
