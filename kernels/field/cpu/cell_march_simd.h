// Marches the density of an adaptive field along a ray; compiled once per instruction set.
//
// The walk from cell to cell is scalar. What it finds is collected kWide cells at a time, and
// their densities and opacities are vectors, as in march_simd.h.
#pragma once

#include "kernels/field/cell_walk.h"
#include "kernels/field/cpu/march_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Cells on a ray, one per lane.
struct alignas(64) CellBlock {
  int32_t cell[kWide] = {};
  float x[kWide] = {}, y[kWide] = {}, z[kWide] = {};  // fractions
  float t[kWide] = {}, delta[kWide] = {};
  int count = 0;
};

// Everything about a block of cells except the transmittance; the first `count` lanes count.
inline void MarchCellBlock(const FastGrid& grid, const CellBlock& in, StepBlock* block) {
  const auto load = [](const float* from) {
    Wide v;
    std::memcpy(&v, from, sizeof(v));
    return v;
  };
  std::memcpy(block->vertex, in.cell, sizeof(in.cell));
  std::memcpy(block->t, in.t, sizeof(in.t));
  alignas(64) float corner[8][kWide];
  for (int lane = 0; lane < kWide; ++lane) {
    const int32_t* const vertex = grid.cells.corner.data() + 8 * int64_t{in.cell[lane]};
    for (int k = 0; k < 8; ++k) corner[k][lane] = grid.vertex_density[vertex[k]];
  }
  const Wide x1 = load(in.x), y1 = load(in.y), z1 = load(in.z);
  const Wide x0 = 1.0f - x1, y0 = 1.0f - y1, z0 = 1.0f - z1;
  const Wide rows[4] = {x0 * y0, x0 * y1, x1 * y0, x1 * y1};
  Wide density{};
  for (int k = 0; k < 8; ++k) {
    const Wide w = rows[k / 2] * (k & 1 ? z1 : z0);
    density += w * load(corner[k]);
    std::memcpy(block->corner_weight[k], &w, sizeof(w));
  }
  SetOpacity(density, load(in.delta), Ramp() < Fill(static_cast<float>(in.count)), block);
}

// As March of a uniform grid; t is in world units.
inline void MarchCellRay(const FastGrid& grid, const Ray& ray, const MarchOptions& options,
                         Marched* result) {
  result->Clear();
  result->world_per_voxel = 1;
  CellBlock cells;
  const auto composite = [&] {
    MarchCellBlock(grid, cells, result->next_block());
    cells.count = 0;
    return result->Composite(options.stop_transmittance);
  };
  bool stopped = false;
  CellPath cell_at(ViewOf(grid.cells, grid.frame.resolution));
  const auto collect = [&](const CellSample<float>& sample) {
    if (sample.cell == kNoCell) return true;
    const int lane = cells.count++;
    cells.cell[lane] = sample.cell;
    cells.x[lane] = sample.fraction.x;
    cells.y[lane] = sample.fraction.y;
    cells.z[lane] = sample.fraction.z;
    cells.t[lane] = sample.t;
    cells.delta[lane] = sample.delta;
    if (cells.count == kWide) stopped = composite();
    return !stopped;
  };
  WalkCellsFoundBy(grid.frame, cell_at, ray, grid.near_clip, collect);
  if (cells.count > 0 && !stopped) composite();
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
