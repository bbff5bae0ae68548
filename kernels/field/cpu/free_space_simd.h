// The gradient of EQ(free-space) on the CPU; compiled once per instruction set. The walk is
// scalar, as that of a training ray.
#pragma once

#include "kernels/field/cpu/scatter_simd.h"
#include "kernels/field/free_space.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Adds the gradient of scale * sum of the rays' opacities.
inline void FreeSpace(const FastGrid& grid, const FreeRay* rays, int64_t n, float scale,
                      GradientArena* arena) {
  const int lanes = grid.lanes(), lane = DensityLane(grid.basis);
  const CellsView cells = ViewOf(grid.cells(), grid.frame.resolution);
  const float* const density = grid.vertex_density.data();
  std::vector<std::pair<int32_t, float>> terms;  // of one ray
  for (int64_t r = 0; r < n; ++r) {
    const float opacity =
        OpacityBefore(grid.frame, cells, density, rays[r].ray, grid.near_clip, rays[r].length);
    if (!(opacity > 0)) continue;
    terms.clear();
    OpacityBeforeAdjoint(grid.frame, cells, density, rays[r].ray, grid.near_clip,
                         rays[r].length, opacity, scale, [&](int32_t vertex, float gradient) {
                           terms.push_back({vertex, gradient});
                         });
    ReserveSlots(arena, static_cast<int64_t>(terms.size()), lanes);
    for (const auto& [vertex, gradient] : terms)
      arena->gradient[int64_t{SlotOf(arena, vertex, lanes)} * lanes + lane] += gradient;
  }
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
