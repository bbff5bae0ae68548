// A ray's way through the cells of an adaptive field.
//
// EQ(cell-march): a ray crosses each cell in one interval, between the planes of the cell's
// faces; its sample is at the interval's middle, and the interval's length is delta in
// EQ(composite). The intervals of all cells and empty cubes join without gap or overlap, for
// the next cube is found by its integer position, never by a rounded one: the plane that ends
// an interval begins the next. Their lengths sum to the ray's length in the box.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/field/cell_grid.h"
#include "kernels/field/grid_frame.h"
#include "kernels/scene/camera.h"

namespace regrade {

template <typename T>
struct CellSample {
  int32_t cell;      // kNoCell: an empty cube
  int width;         // of the cell or cube, voxels
  Vec3<T> fraction;  // of the sample in the cell, in [0, 1]
  T t;               // of the sample, world units along the ray
  T delta;           // length of the interval, world units
};

// Calls body(sample) front to back for each cell and empty cube on the ray beyond near_clip
// (world units); it returns false to end the ray. A ray with a zero or non-finite direction or
// origin has no samples. `cell_at(at, &width)` finds a cell as CellAt does.
template <typename T, typename Find, typename Body>
HD void WalkCellsFoundBy(const GridFrame& frame, Find& cell_at, const RayT<T>& ray, T near_clip,
                         const Body& body) {
  using std::floor;
  if (!AllFinite(ray.origin) || !AllFinite(ray.direction)) return;
  const Vec3f scale = frame.Scale();
  Vec3<T> origin, direction, inverse;  // voxels from the box's centre
  T begin = near_clip, end = T(3.4e38);
  bool moves = false;
  for (int a = 0; a < 3; ++a) {
    origin[a] = (ray.origin[a] - T(frame.center[a])) * T(scale[a]);
    direction[a] = ray.direction[a] * T(scale[a]);
    const T half = T(frame.resolution[a]) / 2;
    inverse[a] = 0;
    if (direction[a] == 0) {
      if (!(origin[a] >= -half && origin[a] < half)) return;
      continue;
    }
    moves = true;
    inverse[a] = 1 / direction[a];
    const T t0 = (-half - origin[a]) * inverse[a], t1 = (half - origin[a]) * inverse[a];
    begin = begin > (t0 < t1 ? t0 : t1) ? begin : (t0 < t1 ? t0 : t1);
    end = end < (t0 < t1 ? t1 : t0) ? end : (t0 < t1 ? t1 : t0);
  }
  if (!moves || !(end > begin)) return;

  // The voxel at t, within [low, low + width) of each axis.
  const auto voxel_at = [&](int a, T t, int low, int width) {
    const T from_corner = floor(origin[a] + direction[a] * t) + T(frame.resolution[a] / 2);
    const int highest = low + width - 1;
    return from_corner >= T(low)
               ? (from_corner <= T(highest) ? static_cast<int>(from_corner) : highest)
               : low;
  };
  Vec3i at;
  for (int a = 0; a < 3; ++a) at[a] = voxel_at(a, begin, 0, frame.resolution[a]);
  for (T t = begin;;) {
    CellSample<T> sample;
    sample.cell = cell_at(at, &sample.width);
    Vec3i low;
    T next = end;
    int axis = -1;
    for (int a = 0; a < 3; ++a) {
      low[a] = at[a] & ~(sample.width - 1);
      if (direction[a] == 0) continue;
      const int face = direction[a] > 0 ? low[a] + sample.width : low[a];
      const T crossing = (T(face - frame.resolution[a] / 2) - origin[a]) * inverse[a];
      if (crossing < next) next = crossing, axis = a;
    }
    if (next < t) next = t;
    sample.delta = next - t;
    sample.t = t + sample.delta / 2;
    const T per_width = T(1) / T(sample.width);  // exact: a power of two
    for (int a = 0; a < 3; ++a) {
      const T inside =
          (origin[a] + direction[a] * sample.t - T(low[a] - frame.resolution[a] / 2)) *
          per_width;
      sample.fraction[a] = inside >= 0 ? (inside <= 1 ? inside : T(1)) : T(0);
    }
    if (!body(sample) || axis < 0 || !(next < end)) return;
    if (sample.width > 1)  // a cube of one voxel has no other
      for (int a = 0; a < 3; ++a)
        if (a != axis) at[a] = voxel_at(a, next, low[a], sample.width);
    at[axis] = direction[axis] > 0 ? low[axis] + sample.width : low[axis] - 1;
    if (at[axis] < 0 || at[axis] >= frame.resolution[axis]) return;
    t = next;
  }
}

template <typename T, typename Body>
HD void WalkCells(const GridFrame& frame, const CellsView& cells, const RayT<T>& ray,
                  T near_clip, const Body& body) {
  const auto cell_at = [&](const Vec3i& at, int* width) { return CellAt(cells, at, width); };
  WalkCellsFoundBy(frame, cell_at, ray, near_clip, body);
}

}  // namespace regrade
