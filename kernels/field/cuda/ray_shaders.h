// A warp's sample colours for rendering. Device code only.
#pragma once

#include "kernels/field/cuda/warp_shade.h"

#if defined(__CUDACC__)

namespace regrade {

// Colours from the grid's own records: every lane of a group gets its sample's three channels.
template <int kBasis>
class RayShader {
 public:
  static constexpr int kGroup = RecordLayout<kBasis>::kGroup;

  __device__ RayShader(const DeviceGridView& grid, const float (&basis)[kMaxVoxelBasis],
                       int lane)
      : grid_(grid), values_(lane, basis), lane_(lane) {}
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

}  // namespace regrade

#endif
