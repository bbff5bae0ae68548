// Colours of a ray's samples, and their sum; compiled once per instruction set.
#pragma once

#include <algorithm>
#include <cstdint>

#include "kernels/field/cpu/march_simd.h"
#include "kernels/field/cpu/record_simd.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// For each channel, Gamma of a ray's direction in the lanes of that channel and 0 in all
// others: its product with a record has only that channel's terms.
template <int kBasis>
struct RayBasis {
  Record<kBasis> channel[3];

  explicit RayBasis(const Vec3f& direction) {
    float gamma[kMaxBasis];
    ShBasis(kBasis, direction, gamma);
    for (int c = 0; c < 3; ++c) {
      alignas(64) float lanes[RecordLanes(kBasis)] = {};
      for (int k = 0; k < kBasis; ++k) lanes[c * kBasis + k] = gamma[k];
      channel[c] = Record<kBasis>::Load(lanes);
    }
  }
};

// Of the corners of the cell whose lowest one is `vertex`.
inline void LoadLinks(const FastGrid& grid, const CornerOffsets& offsets, int32_t vertex,
                      int32_t* link) {
  const Probe* lowest = grid.probes.data() + vertex;
  for (int row = 0; row < 4; ++row)
    for (int z = 0; z < 2; ++z) link[2 * row + z] = lowest[offsets[row] + z].link;
}

// Sum over eight stored corners of weight times record; weights lie `stride` apart.
template <int kBasis>
inline Record<kBasis> Blend(const float* records, const float* weight, int stride,
                            const int32_t* link) {
  constexpr int kLanes = RecordLanes(kBasis);
  auto sum = Record<kBasis>::Zero();
#pragma GCC unroll 8
  for (int k = 0; k < 8; ++k)
    sum.AddScaled(weight[k * stride], records + static_cast<int64_t>(link[k]) * kLanes);
  return sum;
}

// The same if some corners, but not all, may be empty; `weight` is one lane of
// StepBlock::corner_weight. An empty corner reads another corner's record with weight 0:
// selecting records is faster than branching.
template <int kBasis>
inline Record<kBasis> InterpolateRecord(const float* records, const float* weight,
                                        const int32_t* link) {
  int32_t all = 0;  // negative if a corner is empty
  for (int k = 0; k < 8; ++k) all |= link[k];
  if (all >= 0) return Blend<kBasis>(records, weight, kWide, link);
  int32_t stored = 0;
  for (int k = 0; k < 8; ++k) stored = std::max(stored, link[k]);
  float some_weight[8];
  int32_t some_link[8];
  for (int k = 0; k < 8; ++k) {
    some_weight[k] = link[k] < 0 ? 0.0f : weight[k * kWide];
    some_link[k] = link[k] < 0 ? stored : link[k];
  }
  return Blend<kBasis>(records, some_weight, 1, some_link);
}

// Fills raw of all samples. Returns the sum of w max(raw, 0), without the background, and in
// the last lane the sum of w t, in voxels.
template <int kBasis>
inline Quad Shade(const FastGrid& grid, const RayBasis<kBasis>& basis, Marched* marched) {
  using Vector = typename Record<kBasis>::Vector;
  const Vector one{1};  // in the first lane: assigning a lane of a vector goes through memory
  constexpr int64_t kAhead = 8;
  const CornerOffsets offsets(grid.frame);
  const int64_t n = marched->num_samples;
  Sample* const samples = marched->samples.data();
  const float* const records = grid.records.data();
  Quad color{};
  for (int64_t i = -kAhead; i < n; ++i) {
    if (i + kAhead < n) {
      Sample& ahead = samples[i + kAhead];
      const int32_t vertex = marched->block(ahead).vertex[ahead.lane];
      LoadLinks(grid, offsets, vertex, ahead.corner);
      for (int k = 0; k < 8; ++k) PrefetchRecord<kBasis>(records, ahead.corner[k]);
    }
    if (i < 0) continue;
    Sample& sample = samples[i];
    const StepBlock& block = marched->block(sample);
    const int lane = sample.lane;
    const Record<kBasis> blend =
        InterpolateRecord<kBasis>(records, &block.corner_weight[0][lane], sample.corner);
    Vector terms[4]{};
    for (int c = 0; c < 3; ++c)
      for (int j = RecordShape<kBasis>::kFirst(c); j <= RecordShape<kBasis>::kLast(c); ++j)
        terms[c] += blend.v[j] * basis.channel[c].v[j];
    terms[3] = block.t[lane] * one;
    sample.raw = SumEach(terms[0], terms[1], terms[2], terms[3]) + Quad{0.5f, 0.5f, 0.5f, 0.0f};
    const Quad seen = sample.raw > Quad{} ? sample.raw : Quad{};
    color += marched->weight(sample) * seen;
  }
  return color;
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
