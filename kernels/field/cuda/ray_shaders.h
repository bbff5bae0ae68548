// Sources of a warp's sample colours for rendering: the grid's own records, or a copy in half
// precision. Device code only.
#pragma once

#include "kernels/field/cuda/half_grid_sampler.h"
#include "kernels/field/cuda/warp_shade.h"

#if defined(__CUDACC__)

namespace regrade {

// Colours from the grid's own records: every lane of a group gets its sample's three channels.
template <int kBasis>
class FloatShader {
 public:
  using Sampler = GridSampler;
  static constexpr int kGroup = RecordLayout<kBasis>::kGroup;

  __device__ FloatShader(const DeviceGridView& grid, const float (&basis)[kMaxVoxelBasis],
                         int lane)
      : grid_(grid), values_(lane, basis), lane_(lane) {}
  __device__ Sampler sampler() const { return Sampler(grid_); }
  __device__ void Add(int vertex, const Vec3f& fraction, bool valid, float weight) {
    const Vec3f raw = RawColor(grid_, values_, vertex, fraction, valid, lane_);
    if (lane_ % kGroup != 0) return;
    for (int c = 0; c < 3; ++c) color_[c] += weight * fmaxf(raw[c], 0.0f);
  }
  __device__ Vec3f Sum() const {
    return {WarpSum(color_[0]), WarpSum(color_[1]), WarpSum(color_[2])};
  }

 private:
  const DeviceGridView& grid_;
  LaneValues<kBasis> values_;
  int lane_;
  Vec3f color_{};
};

// Colours from a HalfGrid: lane c of four computes channel c, the last one the ninth
// coefficients of all channels.
class HalfShader {
 public:
  using Sampler = HalfGridSampler;
  static constexpr int kGroup = 4;

  __device__ HalfShader(const HalfGridView& grid, const float (&basis)[kMaxVoxelBasis],
                        int lane)
      : grid_(grid), records_(grid.records + lane % kGroup * 8), lane_(lane) {
#pragma unroll
    for (int i = 0; i < 8; ++i) gamma_[i] = basis[lane % kGroup == 3 ? 8 : i];
  }
  __device__ Sampler sampler() const { return Sampler(grid_); }
  __device__ void Add(int vertex, const Vec3f& fraction, bool valid, float weight) {
    const GroupLinks<kGroup> links(sampler(), vertex, valid, lane_);
    uint4 corner[8];
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      const int32_t link = links.Of(k);
      corner[k] =
          link < 0 ? uint4{} : *reinterpret_cast<const uint4*>(records_ + int64_t{link} * 32);
    }
    __half2 halves[4] = {};  // blended in half precision; the error is listed in COSTS.md
#pragma unroll
    for (int k = 0; k < 8; ++k) {
      const __half2 weight = __float2half2_rn(CornerWeight(fraction, k));
      const uint32_t words[4] = {corner[k].x, corner[k].y, corner[k].z, corner[k].w};
#pragma unroll
      for (int i = 0; i < 4; ++i)
        halves[i] = __hfma2(weight, *reinterpret_cast<const __half2*>(&words[i]), halves[i]);
    }
    float sum[8];
#pragma unroll
    for (int i = 0; i < 4; ++i) {
      const float2 pair = __half22float2(halves[i]);
      sum[2 * i] = pair.x, sum[2 * i + 1] = pair.y;
    }
    // The last lane's first three values belong to the other lanes' sums.
    float raw = 0.5f;
#pragma unroll
    for (int i = 0; i < 8; ++i) {
      sum[i] *= gamma_[i];
      raw += sum[i];
    }
    const float ninth[3] = {__shfl_sync(kAllLanes, sum[0], 3, kGroup),
                            __shfl_sync(kAllLanes, sum[1], 3, kGroup),
                            __shfl_sync(kAllLanes, sum[2], 3, kGroup)};
    const int channel = lane_ % kGroup;
    raw += channel == 0 ? ninth[0] : channel == 1 ? ninth[1] : ninth[2];
    color_ += weight * fmaxf(raw, 0.0f);
  }
  __device__ Vec3f Sum() const {
    float all = color_;
#pragma unroll
    for (int d = 16; d >= kGroup; d /= 2) all += __shfl_xor_sync(kAllLanes, all, d);
    return {__shfl_sync(kAllLanes, all, 0), __shfl_sync(kAllLanes, all, 1),
            __shfl_sync(kAllLanes, all, 2)};
  }

 private:
  const HalfGridView& grid_;
  const uint16_t* records_;
  int lane_;
  float gamma_[8];
  float color_ = 0;  // of this lane's channel
};

}  // namespace regrade

#endif
