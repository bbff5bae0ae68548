// Trilinear interpolation on the sparse grid and its adjoint.
//
// EQ(trilinear): v(p) = sum over the 8 corners q of the cell of p: prod_a (1 - |p_a - q_a|)
// v_q; an empty corner counts as 0 and takes no gradient (Plenoxels, Sec. 3).
#pragma once

#include "kernels/base/vec.h"
#include "kernels/field/radiance_field.h"

namespace regrade {

template <typename T>
struct Cell {
  int32_t vertex;    // linear index of the cell's lowest corner
  Vec3<T> fraction;  // in [0, 1]; 1 only on the last face
};

// `p` must be finite; it is clamped to the vertices' range [0, N - 1].
template <typename T>
HD REGRADE_ALWAYS_INLINE Cell<T> LocateCell(const GridFrame& frame, const Vec3<T>& p) {
  Cell<T> cell;
  int base[3];
  for (int a = 0; a < 3; ++a) {
    const T top = T(frame.resolution[a] - 1);
    const T clamped =
        p[a] >= 0 ? (p[a] <= top ? p[a] : top) : T(0);  // NaN goes to 0, not to a cast
    int i = static_cast<int>(clamped);
    if (i > frame.resolution[a] - 2) i = frame.resolution[a] - 2;
    base[a] = i;
    cell.fraction[a] = clamped - T(i);
  }
  cell.vertex = static_cast<int32_t>(frame.Vertex(base[0], base[1], base[2]));
  return cell;
}

// Corner k of 8: bit 2 is +x, bit 1 is +y, bit 0 is +z.
HD inline int32_t CornerVertex(const GridFrame& frame, int32_t vertex, int corner) {
  return vertex + ((corner >> 2) & 1) * frame.resolution.y * frame.resolution.z +
         ((corner >> 1) & 1) * frame.resolution.z + (corner & 1);
}

template <typename T>
HD T CornerWeight(const Vec3<T>& fraction, int corner) {
  const T wx = (corner & 4) ? fraction.x : 1 - fraction.x;
  const T wy = (corner & 2) ? fraction.y : 1 - fraction.y;
  const T wz = (corner & 1) ? fraction.z : 1 - fraction.z;
  return wx * wy * wz;
}

// out [channels] = interpolation of values [N, stride] at `cell`.
template <typename T>
HD void Interpolate(const GridFrame& frame, const int32_t* links, const T* values, int stride,
                    int channels, const Cell<T>& cell, T* out) {
  for (int c = 0; c < channels; ++c) out[c] = T(0);
  for (int corner = 0; corner < 8; ++corner) {
    const int32_t link = links[CornerVertex(frame, cell.vertex, corner)];
    if (link < 0) continue;
    const T w = CornerWeight(cell.fraction, corner);
    const T* v = values + static_cast<int64_t>(link) * stride;
    for (int c = 0; c < channels; ++c) out[c] += w * v[c];
  }
}

// Adjoint of Interpolate: adds its transpose, applied to d_out [channels], to d_values
// [N, stride]. `Add(pointer, value)` is a plain or an atomic +=.
template <typename T, typename Add>
HD void InterpolateAdjoint(const GridFrame& frame, const int32_t* links, int stride,
                           int channels, const Cell<T>& cell, const T* d_out, T* d_values,
                           const Add& add) {
  for (int corner = 0; corner < 8; ++corner) {
    const int32_t link = links[CornerVertex(frame, cell.vertex, corner)];
    if (link < 0) continue;
    const T w = CornerWeight(cell.fraction, corner);
    T* d_v = d_values + static_cast<int64_t>(link) * stride;
    for (int c = 0; c < channels; ++c) add(&d_v[c], w * d_out[c]);
  }
}

struct PlainAdd {
  template <typename T>
  HD void operator()(T* target, T value) const {
    *target += value;
  }
};

}  // namespace regrade
