// Total variation and the optimizer's step over voxel records; compiled once per instruction
// set.
#pragma once

#include <cmath>

#include "kernels/field/cpu/record_simd.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

template <int kBasis>
inline void AddToSlot(const Record<kBasis>& more, int32_t slot, GradientArena* arena) {
  float* const at = arena->gradient.data() + static_cast<int64_t>(slot) * RecordLanes(kBasis);
  auto sum = Record<kBasis>::Load(at);
  for (int i = 0; i < RecordShape<kBasis>::kCount; ++i) sum.v[i] += more.v[i];
  sum.Store(at);
}

// See EQ(total-variation). All values of a record at once; an empty neighbour counts as 0 in
// the density lane and as the voxel's own value in the others.
template <int kBasis>
void TotalVariation(const FastGrid& grid, int64_t begin, int64_t end, float scale_density,
                    float scale_sh, GradientArena* arena) {
  using R = Record<kBasis>;
  using Shape = RecordShape<kBasis>;
  using Vector = typename Shape::Vector;
  constexpr int kLanes = Shape::kLanes;
  alignas(64) float scale_lanes[kLanes] = {}, density_mask[kLanes] = {};
  for (int l = 0; l < 3 * kBasis; ++l) scale_lanes[l] = scale_sh;
  scale_lanes[DensityLane(kBasis)] = scale_density;
  density_mask[DensityLane(kBasis)] = 1;
  const R scale = R::Load(scale_lanes), only_density = R::Load(density_mask);
  const Vec3i n = grid.frame.resolution;
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  ReserveSlots(arena, 4 * (end - begin), kLanes);
  for (int64_t vertex = begin; vertex < end; ++vertex) {
    const int32_t link = grid.links[vertex];
    if (link < 0) continue;
    const int64_t at[3] = {vertex / strides[0], vertex / strides[1] % n.y, vertex % n.z};
    const R own = R::Load(grid.records.data() + static_cast<int64_t>(link) * kLanes);
    int32_t neighbour[3];
    R difference[3];
    for (int a = 0; a < 3; ++a) {
      const bool in_box = at[a] + 1 < n[a];
      neighbour[a] = in_box ? grid.links[vertex + strides[a]] : -1;
      const float axis = static_cast<float>(n[a]) / 256.0f;
      if (neighbour[a] >= 0) {
        const R other =
            R::Load(grid.records.data() + static_cast<int64_t>(neighbour[a]) * kLanes);
        for (int i = 0; i < Shape::kCount; ++i)
          difference[a].v[i] = axis * (other.v[i] - own.v[i]);
      } else {
        // No difference is taken across the box's border; an empty voxel in it has density 0.
        const float missing = in_box ? -axis : 0.0f;
        for (int i = 0; i < Shape::kCount; ++i)
          difference[a].v[i] = missing * only_density.v[i] * own.v[i];
      }
    }
    const int32_t own_slot = SlotOf(arena, link, kLanes);
    R factor[3], d_own = R::Zero();
    for (int i = 0; i < Shape::kCount; ++i) {
      const Vector sum = difference[0].v[i] * difference[0].v[i] +
                         difference[1].v[i] * difference[1].v[i] +
                         difference[2].v[i] * difference[2].v[i] + 1e-9f;
      const Vector inverse = scale.v[i] / SquareRoot(sum);
      for (int a = 0; a < 3; ++a) {
        const float axis = static_cast<float>(n[a]) / 256.0f;
        factor[a].v[i] = axis * difference[a].v[i] * inverse;
        d_own.v[i] -= factor[a].v[i];
      }
    }
    AddToSlot(d_own, own_slot, arena);
    for (int a = 0; a < 3; ++a) {
      if (neighbour[a] < 0) continue;
      AddToSlot(factor[a], SlotOf(arena, neighbour[a], kLanes), arena);
    }
  }
}

template <int kBasis>
int64_t Step(FastGrid* grid, float* second_moment, const GradientArena* arenas, int num_arenas,
             int self, int64_t begin, int64_t end, const RmspropOptions& options) {
  using R = Record<kBasis>;
  using Shape = RecordShape<kBasis>;
  using Vector = typename Shape::Vector;
  constexpr int kLanes = Shape::kLanes;
  alignas(64) float rate_lanes[kLanes] = {};
  for (int l = 0; l < 3 * kBasis; ++l) rate_lanes[l] = options.rate_sh;
  rate_lanes[DensityLane(kBasis)] = options.rate_density;
  const R rate = R::Load(rate_lanes);
  alignas(64) float low_lanes[kLanes], high_lanes[kLanes];
  static_assert(RmspropOptions().mean_bound == static_cast<float>(0.5 / kSh0));
  for (int l = 0; l < kLanes; ++l) {
    const float bound = l >= 3 * kBasis   ? kUnbounded
                        : l % kBasis == 0 ? options.mean_bound
                                          : options.view_bound;
    low_lanes[l] = -bound;
    high_lanes[l] = bound;
  }
  const R low = R::Load(low_lanes), high = R::Load(high_lanes);
  // The copy of a voxel's density that marches read.
  const auto density_of = [&](int32_t voxel) {
    return &grid->probes[grid->vertex_of_voxel[voxel]].density;
  };
  int64_t rejected = 0;
  constexpr int64_t kAhead = 8;  // slots are in ray order, so voxels are scattered in memory
  for (int64_t slot = begin; slot < end; ++slot) {
    if (slot + 2 * kAhead < end)
      __builtin_prefetch(&grid->vertex_of_voxel[arenas[self].voxel_of_slot[slot + 2 * kAhead]]);
    if (slot + kAhead < end) {
      const int32_t ahead = arenas[self].voxel_of_slot[slot + kAhead];
      PrefetchRecord<kBasis>(grid->records.data(), ahead, true);
      PrefetchRecord<kBasis>(second_moment, ahead, true);
      __builtin_prefetch(density_of(ahead), 1);
    }
    const int32_t voxel = arenas[self].voxel_of_slot[slot];
    bool mine = true;
    for (int other = 0; other < self; ++other)
      mine = mine && arenas[other].slot_of_voxel[voxel] < 0;
    if (!mine) continue;
    R g = R::Load(arenas[self].gradient.data() + slot * kLanes);
    for (int other = self + 1; other < num_arenas; ++other) {
      const int32_t other_slot = arenas[other].slot_of_voxel[voxel];
      if (other_slot < 0) continue;
      const R more =
          R::Load(arenas[other].gradient.data() + static_cast<int64_t>(other_slot) * kLanes);
      for (int i = 0; i < Shape::kCount; ++i) g.v[i] += more.v[i];
    }
    // The sum is finite only if all lanes and their squares are.
    Vector check{};
    for (int i = 0; i < Shape::kCount; ++i) check += g.v[i] * g.v[i];
    if (!std::isfinite(SumOf(FoldToQuad(check)))) {
      ++rejected;
      continue;
    }
    float* values = grid->records.data() + static_cast<int64_t>(voxel) * kLanes;
    float* moments = second_moment + static_cast<int64_t>(voxel) * kLanes;
    const R v = R::Load(moments), x = R::Load(values);
    R new_v, new_x;
    for (int i = 0; i < Shape::kCount; ++i) {
      const Vector squared = g.v[i] * g.v[i];
      const Vector blended = options.beta * v.v[i] + (1 - options.beta) * squared;
      new_v.v[i] = v.v[i] == 0.0f ? squared : blended;
      const Vector stepped =
          x.v[i] - rate.v[i] * g.v[i] / (SquareRoot(new_v.v[i]) + options.epsilon);
      const Vector raised = stepped < low.v[i] ? low.v[i] : stepped;
      new_x.v[i] = raised > high.v[i] ? high.v[i] : raised;
    }
    new_v.Store(moments);
    new_x.Store(values);
    *density_of(voxel) = values[DensityLane(kBasis)];
  }
  return rejected;
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
