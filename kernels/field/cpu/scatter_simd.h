// The adjoint of a ray's colour, added to the gradients of the voxels it read; compiled once
// per instruction set.
#pragma once

#include <algorithm>
#include <cstdint>

#include "kernels/field/cpu/march_simd.h"
#include "kernels/field/cpu/record_simd.h"
#include "kernels/field/cpu/shade_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Finds the gradient of each corner of each sample.
template <int kBasis>
inline void FindSlots(Marched* marched, GradientArena* arena) {
  constexpr int kLanes = RecordLanes(kBasis);
  constexpr int64_t kAhead = 8;
  ReserveSlots(arena, 8 * marched->num_samples, kLanes);
  const int64_t n = marched->num_samples;
  Sample* const samples = marched->samples.data();
  for (int64_t i = 0; i < n; ++i) {
    if (i + kAhead < n)
      for (const int32_t corner : samples[i + kAhead].corner)
        __builtin_prefetch(&arena->slot_of_voxel[std::max(corner, 0)]);
    for (int32_t& corner : samples[i].corner)
      if (corner >= 0) corner = SlotOf(arena, corner, kLanes);
  }
}

// Adds dL/d(record) of all samples for dL/dC = d_color, last sample to first; `behind` is the
// radiance behind the box. See EQ(composite-adjoint).
template <int kBasis>
inline void ScatterRay(const RayBasis<kBasis>& basis, const Vec3f& d_color, Quad behind,
                       const DensityLosses& losses, Marched* marched, GradientArena* arena) {
  using Shape = RecordShape<kBasis>;
  constexpr int kLanes = Shape::kLanes;
  constexpr int kDensityVector = DensityLane(kBasis) / Shape::kWidth;
  typename Shape::Vector density_mask{};
  density_mask[DensityLane(kBasis) % Shape::kWidth] = 1;
  FindSlots<kBasis>(marched, arena);
  float* const gradient = arena->gradient.data();
  const auto slot_at = [&](int32_t slot) {
    return gradient + static_cast<int64_t>(slot) * kLanes;
  };
  constexpr int64_t kAhead = 6;
  const Quad d_quad{d_color.x, d_color.y, d_color.z,
                    0};  // the last lane of raw is not a colour
  for (int64_t i = marched->num_samples; i-- > 0;) {
    if (i >= kAhead) {
      const Sample& ahead = marched->samples[static_cast<size_t>(i - kAhead)];
      for (int k = 0; k < 8; ++k) PrefetchRecord<kBasis>(gradient, ahead.corner[k], true);
    }
    const Sample& s = marched->samples[static_cast<size_t>(i)];
    const StepBlock& block = marched->block(s);
    const float alpha = block.alpha[s.lane], decay = block.decay[s.lane];
    const float before = block.transmittance_before[s.lane];
    const Quad color = s.raw > Quad{} ? s.raw : Quad{};
    float d_sigma = block.slope[s.lane] * before * decay * SumOf((color - behind) * d_quad);
    if (losses.on() && block.slope[s.lane] > 0)
      d_sigma += DensityLossSlope(losses, marched->transmittance, block.density[s.lane],
                                  block.slope[s.lane]);
    behind = color * alpha + behind * decay;

    const Quad d_raw = s.raw > Quad{} ? before * alpha * d_quad : Quad{};
    auto d_record = Record<kBasis>::Zero();
    for (int c = 0; c < 3; ++c)
      for (int j = Shape::kFirst(c); j <= Shape::kLast(c); ++j)
        d_record.v[j] += d_raw[c] * basis.channel[c].v[j];
    d_record.v[kDensityVector] += d_sigma * density_mask;
    for (int k = 0; k < 8; ++k) {
      if (s.corner[k] < 0) continue;
      const float weight = block.corner_weight[k][s.lane];
      float* const slot = slot_at(s.corner[k]);
      auto sum = Record<kBasis>::Load(slot);
      for (int j = 0; j < Shape::kCount; ++j) sum.v[j] += weight * d_record.v[j];
      sum.Store(slot);
    }
  }
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
