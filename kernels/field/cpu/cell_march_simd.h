// Marches the density of an adaptive field along rays; compiled once per instruction set.
//
// kWide rays walk side by side, one per lane: EQ(cell-march) for all of them at once. What a
// lane finds is collected kWide cells at a time, and their densities and opacities are vectors,
// as in march_simd.h. A lane whose ray has ended takes the next one.
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
    const int32_t* const vertex = grid.cells().corner.data() + 8 * int64_t{in.cell[lane]};
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

// CellPath (cell_grid.h) for all lanes: they go down the tree side by side, so that their loads
// overlap.
class CellPaths {
 public:
  explicit CellPaths(const CellsView& cells) : cells_(cells) {}

  // Finds the cell or cube at the voxel of each lane.
  void Find(const int32_t (&at)[3][kWide], CellStep* step) {
    const WideInt x = LoadWide(at[0]), y = LoadWide(at[1]), z = LoadWide(at[2]);
    // The cube that holds the last voxel, too, is 2^shift wide: a float's exponent is the
    // number of bits, for a lattice has fewer than 2^24 voxels along an axis.
    const Wide differs = __builtin_convertvector((x ^ x_) | (y ^ y_) | (z ^ z_), Wide);
    WideInt bits;
    std::memcpy(&bits, &differs, sizeof(bits));
    WideInt shift = (bits >> 23) - 126;
    shift = shift > leaf_shift_ ? shift : leaf_shift_;
    x_ = x, y_ = y, z_ = z;
    alignas(64) int32_t entry[kWide], from[kWide], index[kWide];
    std::memcpy(from, &shift, sizeof(from));
    for (int l = 0; l < kWide; ++l) {
      if (from[l] > cells_.finest) {
        from[l] = cells_.finest;
        entry_[from[l]][l] =
            cells_.top[((at[0][l] >> from[l]) * cells_.top_size.y + (at[1][l] >> from[l])) *
                           cells_.top_size.z +
                       (at[2][l] >> from[l])];
      }
      entry[l] = entry_[from[l]][l];
    }
    shift = LoadWide(from);
    for (WideInt found = LoadWide(entry);;) {
      const WideInt node = found < WideInt{} + kNoCell;  // -1: has children
      if (!AnyOf(node)) {
        leaf_shift_ = shift;
        const WideInt width = (WideInt{} + 1) << shift;
        std::memcpy(step->cell, &found, sizeof(found));
        std::memcpy(step->width, &width, sizeof(width));
        return;
      }
      shift += node;
      const WideInt child = (x >> shift & 1) << 2 | (y >> shift & 1) << 1 | (z >> shift & 1);
      const WideInt place = node ? (-2 - found) * 8 + child : WideInt{};
      std::memcpy(index, &place, sizeof(place));
      std::memcpy(from, &shift, sizeof(from));
      std::memcpy(entry, &found, sizeof(found));
      for (int l = 0; l < kWide; ++l) {
        const int32_t below = cells_.nodes[static_cast<uint32_t>(index[l])];
        entry[l] = IsNode(entry[l]) ? below : entry[l];
        entry_[from[l]][l] = entry[l];
      }
      found = LoadWide(entry);
    }
  }

 private:
  static constexpr int kMostLevels = 32;

  CellsView cells_;
  WideInt x_{}, y_{}, z_{};                 // the last voxels
  WideInt leaf_shift_ = WideInt{} + 31;     // so that the first search begins at the top
  int32_t entry_[kMostLevels][kWide] = {};  // of the cube of 2^k voxels with the last voxel
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
    int64_t ray = -1;  // none
    CellBlock cells;
    Marched marched;
  };
  const CellsView view = ViewOf(grid.cells(), grid.frame.resolution);
  std::vector<Lane> lane(static_cast<size_t>(std::min<int64_t>(n, kWide)));
  CellPaths paths(view);
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
    // Steps of a lane without a ray stay in the first cube.
    for (int a = 0; a < 3; ++a) lanes.direction[a][l] = 0, lanes.at[a][l] = 0;
    --walking;
  };
  walking = used;
  for (int l = 0; l < used; ++l) begin(l);
  const auto composite = [&](Lane* own) {
    MarchCellBlock(grid, own->cells, own->marched.next_block());
    own->cells.count = 0;
    return own->marched.Composite(options.stop_transmittance);
  };
  while (walking > 0) {
    paths.Find(lanes.at, &step);
    StepLanes(grid.frame, &lanes, &step);
    for (int l = 0; l < used; ++l) {
      Lane& own = lane[static_cast<size_t>(l)];
      if (own.ray < 0) continue;
      bool stopped = false;
      if (step.cell[l] != kNoCell) {
        const int i = own.cells.count++;
        __builtin_prefetch(view.corner + 8 * int64_t{step.cell[l]});
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
