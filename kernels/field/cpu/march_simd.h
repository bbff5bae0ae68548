// Marches the density along a ray, many steps at once; compiled once per instruction set.
//
// Between skips through empty space a ray is marched in blocks of kWide steps: positions,
// corner weights, density and opacity are vectors over the steps, and only the transmittance
// is sequential. A block may include empty cells: their density is exactly zero.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/cpu/opacity_simd.h"
#include "kernels/field/cpu/rays.h"
#include "kernels/field/cpu/skip_simd.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

// Consecutive steps, one per lane.
struct alignas(64) StepBlock {
  float corner_weight[8][kWide];
  int32_t vertex[kWide];  // lowest corner of the cell
  int32_t composited[kWide];
  float t[kWide];  // voxels
  float alpha[kWide];
  float decay[kWide];  // exp(-tau)
  float slope[kWide];  // dtau/dsigma, world units; 0 if sigma or tau is clamped
  float density[kWide];
  float transmittance_before[kWide];
};

// A sample that composites.
struct Sample {
  Quad raw;  // colour before the clamp at 0; the last lane is t, in voxels
  int32_t block, lane;
  int32_t corner[8];  // voxels, -1 if empty; their gradient slots during the adjoint
};

struct Marched {
  std::vector<StepBlock> blocks;
  std::vector<Sample> samples;  // capacity; the first num_samples are this ray's
  int64_t num_samples = 0;
  int32_t num_blocks = 0;  // with samples
  float world_per_voxel = 0;
  float transmittance = 1;

  const StepBlock& block(const Sample& sample) const {
    return blocks[static_cast<size_t>(sample.block)];
  }
  float weight(const Sample& sample) const {
    const StepBlock& b = block(sample);
    return b.transmittance_before[sample.lane] * b.alpha[sample.lane];
  }

  void Clear() {
    num_samples = 0;
    num_blocks = 0;
    transmittance = 1;
  }
  StepBlock* next_block() {
    if (blocks.size() <= static_cast<size_t>(num_blocks)) {
      blocks.resize(2 * blocks.size() + 16);
      samples.resize(blocks.size() * kWide + 1);
    }
    return &blocks[static_cast<size_t>(num_blocks)];
  }
  // Keeps the samples of the next block that composite; true if the ray ends among them.
  bool Composite(float stop_transmittance) {
    StepBlock& block = blocks[static_cast<size_t>(num_blocks)];
    Sample* const first = samples.data() + num_samples;
    Sample* next = first;
    bool stopped = false;
    for (int lane = 0; lane < kWide; ++lane) {
      next->block = num_blocks;
      next->lane = lane;
      next -= block.composited[lane];  // a true comparison is -1
      block.transmittance_before[lane] = transmittance;
      transmittance *= block.decay[lane];  // 1 for a sample that does not composite
      if (transmittance < stop_transmittance && block.composited[lane] != 0) {
        stopped = true;
        break;
      }
    }
    num_samples += next - first;
    num_blocks += next > first;
    return stopped;
  }
};

// Offsets in memory between the corners of a cell.
struct CornerOffsets {
  int32_t y, x;
  explicit CornerOffsets(const GridFrame& frame)
      : y(frame.resolution.z), x(frame.resolution.y * frame.resolution.z) {}
  // Corners 2 row and 2 row + 1 of trilinear.h are neighbours along z.
  int32_t operator[](int row) const { return (row & 2 ? x : 0) + (row & 1 ? y : 0); }
};

// One coordinate of LocateCell for all steps.
inline WideInt LocateAxis(Wide p, int resolution, Wide* fraction) {
  const Wide top = Fill(static_cast<float>(resolution - 1));
  const Wide positive = p >= Wide{} ? p : Wide{};  // NaN goes to 0
  const Wide clamped = positive <= top ? positive : top;
  const WideInt last = WideInt{} + (resolution - 2);
  const WideInt floor = __builtin_convertvector(clamped, WideInt);
  const WideInt base = floor < last ? floor : last;
  *fraction = clamped - __builtin_convertvector(base, Wide);
  return base;
}

// Positions of the steps [first, first + kWide) of a ray.
struct StepPlaces {
  Wide index, t, x1, y1, z1;  // x1, y1, z1: fractions of a cell
  WideInt vertex;

  StepPlaces(const GridFrame& frame, const GridRay<float>& march, float step, int64_t first) {
    const Vec3i n = frame.resolution;
    index = Ramp() + static_cast<float>(first);
    t = march.t_begin + index * step;
    const WideInt x = LocateAxis(march.origin.x + march.direction.x * t, n.x, &x1);
    const WideInt y = LocateAxis(march.origin.y + march.direction.y * t, n.y, &y1);
    const WideInt z = LocateAxis(march.origin.z + march.direction.z * t, n.z, &z1);
    vertex = (x * n.y + y) * n.z + z;
  }
};

// alpha, decay, slope and composited of a block; see OpticalDepth.
inline void SetOpacity(const Wide& density, const Wide& delta, const WideInt& counts,
                       StepBlock* block) {
  const WideInt composited = (density > Wide{}) & counts;
  constexpr float kDensest = static_cast<float>(kMaxDensity);
  constexpr float kDeepest = static_cast<float>(kMaxOpticalDepth);
  const Wide sigma = density < Fill(kDensest) ? density : Fill(kDensest);
  const Wide product = sigma * delta;
  const Wide bounded = product < Fill(kDeepest) ? product : Fill(kDeepest);
  const Extinction extinction = Extinguish(composited ? bounded : Wide{});
  const WideInt free = (density < Fill(kDensest)) & (product < Fill(kDeepest));
  const Wide slope = free ? delta : Wide{};
  std::memcpy(block->composited, &composited, sizeof(composited));
  std::memcpy(block->alpha, &extinction.alpha, sizeof(slope));
  std::memcpy(block->decay, &extinction.decay, sizeof(slope));
  std::memcpy(block->slope, &slope, sizeof(slope));
  std::memcpy(block->density, &density, sizeof(density));
}

// Everything about steps [first, first + kWide) except the transmittance.
inline void MarchBlock(const FastGrid& grid, const GridRay<float>& march, float step,
                       int64_t first, StepBlock* block) {
  const StepPlaces places(grid.frame, march, step, first);
  const Wide index = places.index, t = places.t;
  const Wide x1 = places.x1, y1 = places.y1, z1 = places.z1;
  std::memcpy(block->vertex, &places.vertex, sizeof(places.vertex));

  const Wide x0 = 1.0f - x1, y0 = 1.0f - y1, z0 = 1.0f - z1;
  const Wide rows[4] = {x0 * y0, x0 * y1, x1 * y0, x1 * y1};
  const CornerOffsets offsets(grid.frame);
  Wide density{};
  for (int row = 0; row < 4; ++row) {
    Wide low, high;
    GatherDensities(grid.probes.data() + offsets[row], block->vertex, &low, &high);
    const Wide w0 = rows[row] * z0, w1 = rows[row] * z1;
    density += w0 * low + w1 * high;
    std::memcpy(block->corner_weight[2 * row], &w0, sizeof(w0));
    std::memcpy(block->corner_weight[2 * row + 1], &w1, sizeof(w1));
  }

  const Wide end = Fill(static_cast<float>(march.num_steps));
  SetOpacity(density, Fill(step * march.world_per_voxel), index < end, block);
  std::memcpy(block->t, &t, sizeof(t));
}

// Marches the density and keeps the samples that composite. Skipped steps, through cells
// without stored corners, would contribute exact zeros.
inline void March(const FastGrid& grid, const Ray& ray, const MarchOptions& options,
                  Marched* result) {
  const GridRay<float> march = ClipToGrid(grid.frame, ray, grid.near_clip, options.step);
  result->world_per_voxel = march.world_per_voxel;
  const EmptySpace empty_space(grid, march, options.step);
  result->Clear();
  bool stopped = false;
  for (int64_t i = 0; i < march.num_steps && !stopped;) {
    const float t = march.t_begin + static_cast<float>(i) * options.step;
    const int64_t empty_steps = empty_space.StepsFrom(march.At(t));
    if (empty_steps > 0) {
      i += empty_steps;
      continue;
    }
    MarchBlock(grid, march, options.step, i, result->next_block());
    i += kWide;
    stopped = result->Composite(options.stop_transmittance);
  }
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
