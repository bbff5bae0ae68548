// Marches the density of an adaptive field along rays; compiled once per instruction set.
//
// kWide rays walk side by side, one per lane: EQ(cell-march) for all of them at once. Only the
// search for the next cell is scalar; its loads are independent from lane to lane. What a lane
// finds is collected kWide cells at a time, and their densities and opacities are vectors, as
// in march_simd.h. A lane whose ray has ended takes the next one.
#pragma once

#include <algorithm>
#include <array>
#include <memory>

#include "kernels/field/cell_grid.h"
#include "kernels/field/cpu/march_simd.h"

namespace regrade::REGRADE_SIMD_NAMESPACE {
namespace {

inline Wide LoadWide(const float* from) {
  Wide v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}

inline WideInt LoadWide(const int32_t* from) {
  WideInt v;
  std::memcpy(&v, from, sizeof(v));
  return v;
}

// Cells on a ray.
struct alignas(64) CellBlock {
  int32_t cell[kWide] = {};
  float x[kWide] = {}, y[kWide] = {}, z[kWide] = {};  // fractions
  float t[kWide] = {}, delta[kWide] = {};
  int count = 0;
};

// Everything about a block of cells except the transmittance; the first `count` cells count.
inline void MarchCellBlock(const FastGrid& grid, const CellBlock& in, StepBlock* block) {
  std::memcpy(block->vertex, in.cell, sizeof(in.cell));
  std::memcpy(block->t, in.t, sizeof(in.t));
  alignas(64) float corner[8][kWide];
  for (int lane = 0; lane < kWide; ++lane) {
    const int32_t* const vertex = grid.cells.corner.data() + 8 * int64_t{in.cell[lane]};
    for (int k = 0; k < 8; ++k) corner[k][lane] = grid.vertex_density[vertex[k]];
  }
  const Wide x1 = LoadWide(in.x), y1 = LoadWide(in.y), z1 = LoadWide(in.z);
  const Wide x0 = 1.0f - x1, y0 = 1.0f - y1, z0 = 1.0f - z1;
  const Wide rows[4] = {x0 * y0, x0 * y1, x1 * y0, x1 * y1};
  Wide density{};
  for (int k = 0; k < 8; ++k) {
    const Wide w = rows[k / 2] * (k & 1 ? z1 : z0);
    density += w * LoadWide(corner[k]);
    std::memcpy(block->corner_weight[k], &w, sizeof(w));
  }
  SetOpacity(density, LoadWide(in.delta), Ramp() < Fill(static_cast<float>(in.count)), block);
}

// The rays in the lanes, as WalkCells (cell_walk.h) has one. A lane without a ray has zeros.
struct alignas(64) CellLanes {
  float origin[3][kWide] = {}, direction[3][kWide] = {}, inverse[3][kWide] = {};
  float t[kWide] = {}, end[kWide] = {};
  int32_t at[3][kWide] = {};
};

// What a step of all lanes finds.
struct alignas(64) CellStep {
  int32_t cell[kWide] = {}, width[kWide] = {};
  float fraction[3][kWide], t[kWide], delta[kWide];
  int32_t ended[kWide];  // -1: the ray leaves the box
};

// Begins a ray in a lane; false if it has no samples.
inline bool BeginRay(const FastGrid& grid, const Ray& ray, int lane, CellLanes* lanes) {
  if (!AllFinite(ray.origin) || !AllFinite(ray.direction)) return false;
  const GridFrame& frame = grid.frame;
  const Vec3f scale = frame.Scale();
  float begin = grid.near_clip, end = 3.4e38f;
  bool moves = false;
  for (int a = 0; a < 3; ++a) {
    const float origin = (ray.origin[a] - frame.center[a]) * scale[a];
    const float direction = ray.direction[a] * scale[a];
    const float half = static_cast<float>(frame.resolution[a]) / 2;
    lanes->origin[a][lane] = origin;
    lanes->direction[a][lane] = direction;
    lanes->inverse[a][lane] = 0;
    if (direction == 0) {
      if (!(origin >= -half && origin < half)) return false;
      continue;
    }
    moves = true;
    const float inverse = lanes->inverse[a][lane] = 1 / direction;
    const float t0 = (-half - origin) * inverse, t1 = (half - origin) * inverse;
    begin = std::max(begin, std::min(t0, t1));
    end = std::min(end, std::max(t0, t1));
  }
  if (!moves || !(end > begin)) return false;
  lanes->t[lane] = begin;
  lanes->end[lane] = end;
  for (int a = 0; a < 3; ++a) {
    const float place = std::floor(lanes->origin[a][lane] + lanes->direction[a][lane] * begin) +
                        static_cast<float>(frame.resolution[a] / 2);
    const int last = frame.resolution[a] - 1;
    lanes->at[a][lane] =
        place >= 0 ? (place <= static_cast<float>(last) ? static_cast<int>(place) : last) : 0;
  }
  return true;
}

// The interval of each lane in its cube of step->width voxels, and the lane's next voxel.
inline void StepLanes(const GridFrame& frame, CellLanes* lanes, CellStep* step) {
  const WideInt width = LoadWide(step->width);
  const Wide t = LoadWide(lanes->t), end = LoadWide(lanes->end);
  Wide next = end;
  WideInt axis = WideInt{} - 1;
  WideInt low[3], beyond[3];  // the voxel behind the face that the ray heads for
  for (int a = 0; a < 3; ++a) {
    const Wide direction = LoadWide(lanes->direction[a]);
    const int half = frame.resolution[a] / 2;
    low[a] = LoadWide(lanes->at[a]) & -width;
    const WideInt ascends = direction > Wide{};
    const WideInt face = ascends ? low[a] + width : low[a];
    beyond[a] = ascends ? face : face - 1;
    const Wide crossing =
        (__builtin_convertvector(face - half, Wide) - LoadWide(lanes->origin[a])) *
        LoadWide(lanes->inverse[a]);
    const WideInt nearer = (direction != Wide{}) & (crossing < next);
    next = nearer ? crossing : next;
    axis = nearer ? WideInt{} + a : axis;
  }
  next = next < t ? t : next;
  const Wide delta = next - t, middle = t + delta * 0.5f;
  const Wide per_width = 1.0f / __builtin_convertvector(width, Wide);  // exact
  WideInt ended = (axis < WideInt{}) | ~(next < end);
  for (int a = 0; a < 3; ++a) {
    const Wide origin = LoadWide(lanes->origin[a]), direction = LoadWide(lanes->direction[a]);
    const int half = frame.resolution[a] / 2;
    const Wide inside =
        (origin + direction * middle - __builtin_convertvector(low[a] - half, Wide)) *
        per_width;
    const Wide one = Fill(1);
    const Wide fraction = inside >= Wide{} ? (inside <= one ? inside : one) : Wide{};
    std::memcpy(step->fraction[a], &fraction, sizeof(fraction));
    // floor() is the integer part, less one for what truncation has raised.
    const Wide place = origin + direction * next;
    WideInt voxel = __builtin_convertvector(place, WideInt);
    voxel += (__builtin_convertvector(voxel, Wide) > place);
    voxel += half;
    const WideInt highest = low[a] + width - 1;
    voxel = voxel < highest ? voxel : highest;
    voxel = voxel > low[a] ? voxel : low[a];
    voxel = axis == WideInt{} + a ? beyond[a] : voxel;
    ended |= (voxel < WideInt{}) | (voxel >= WideInt{} + frame.resolution[a]);
    std::memcpy(lanes->at[a], &voxel, sizeof(voxel));
  }
  std::memcpy(step->t, &middle, sizeof(middle));
  std::memcpy(step->delta, &delta, sizeof(delta));
  std::memcpy(step->ended, &ended, sizeof(ended));
  std::memcpy(lanes->t, &next, sizeof(next));
}

// Marches rays of an adaptive field and calls done(index, &marched) for each, in an order that
// depends on the rays alone. t of the samples is in world units.
template <typename Done>
void MarchCellRays(const FastGrid& grid, const Ray* rays, int64_t n,
                   const MarchOptions& options, const Done& done) {
  struct Lane {
    CellPath cell_at;
    int64_t ray = -1;  // none
    CellBlock cells;
    Marched marched;
    explicit Lane(const CellsView& view) : cell_at(view) {}
  };
  const CellsView view = ViewOf(grid.cells, grid.frame.resolution);
  std::vector<Lane> lane(static_cast<size_t>(std::min<int64_t>(n, kWide)), Lane(view));
  const int used = static_cast<int>(lane.size());
  CellLanes lanes;
  CellStep step;
  int64_t next_ray = 0;
  int walking = 0;
  const auto begin = [&](int l) {
    Lane& own = lane[static_cast<size_t>(l)];
    own.ray = -1;
    while (next_ray < n) {
      own.marched.Clear();
      own.marched.world_per_voxel = 1;
      own.cells.count = 0;
      const int64_t ray = next_ray++;
      if (BeginRay(grid, rays[ray], l, &lanes)) {
        own.ray = ray;
        return;
      }
      done(ray, &own.marched);
    }
    // Steps of a lane without a ray stay at the first voxel.
    for (int a = 0; a < 3; ++a) lanes.direction[a][l] = 0, lanes.at[a][l] = 0;
    step.width[l] = 1;
    --walking;
  };
  walking = used;
  for (int l = 0; l < used; ++l) begin(l);
  for (int l = used; l < kWide; ++l) step.width[l] = 1;
  const auto composite = [&](Lane* own) {
    MarchCellBlock(grid, own->cells, own->marched.next_block());
    own->cells.count = 0;
    return own->marched.Composite(options.stop_transmittance);
  };
  while (walking > 0) {
    for (int l = 0; l < used; ++l) {
      if (lane[static_cast<size_t>(l)].ray < 0) continue;
      step.cell[l] = lane[static_cast<size_t>(l)].cell_at(
          {lanes.at[0][l], lanes.at[1][l], lanes.at[2][l]}, &step.width[l]);
    }
    StepLanes(grid.frame, &lanes, &step);
    for (int l = 0; l < used; ++l) {
      Lane& own = lane[static_cast<size_t>(l)];
      if (own.ray < 0) continue;
      bool stopped = false;
      if (step.cell[l] != kNoCell) {
        const int i = own.cells.count++;
        own.cells.cell[i] = step.cell[l];
        own.cells.x[i] = step.fraction[0][l];
        own.cells.y[i] = step.fraction[1][l];
        own.cells.z[i] = step.fraction[2][l];
        own.cells.t[i] = step.t[l];
        own.cells.delta[i] = step.delta[l];
        if (own.cells.count == kWide) stopped = composite(&own);
      }
      if (!stopped && step.ended[l] == 0) continue;
      if (!stopped && own.cells.count > 0) composite(&own);
      done(own.ray, &own.marched);
      begin(l);
    }
  }
}

}  // namespace
}  // namespace regrade::REGRADE_SIMD_NAMESPACE
