// Total variation of the background's layers, value and gradient.
//
// EQ(sphere-variation): TV = sum over stored texels of sqrt(1e-9 + sum_a (v(next_a) - v)^2),
// separately for each value; next_a is the neighbour to the east (cyclic), to the south (none
// beyond the last row) and on the next layer outwards. An empty neighbour counts as the texel's
// own value.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/field/total_variation.h"

namespace regrade {

// values [columns, layers, stride]: the value at `index` of each texel. Returns the unscaled
// sum over the map's texels [begin, end); calls add(texel, value) with scale * gradient.
template <typename T, typename Add>
T SphereVariation(int layers, int resolution, const int32_t* links, const T* values, int stride,
                  int index, int64_t begin, int64_t end, T scale, const Add& add) {
  const int64_t map = int64_t{2} * resolution * resolution;
  T sum = 0;
  for (int64_t at = begin; at < end; ++at) {
    const int32_t column = links[at];
    if (column < 0) continue;
    const int32_t east = links[(at + resolution) % map];
    const int32_t south = at % resolution + 1 < resolution ? links[at + 1] : -1;
    for (int i = 0; i < layers; ++i) {
      const int32_t own = column * layers + i;
      const int32_t next[3] = {east >= 0 ? east * layers + i : own,
                               south >= 0 ? south * layers + i : own,
                               i + 1 < layers ? own + 1 : own};
      const T value = values[int64_t{own} * stride + index];
      T difference[3], radicand = T(kVariationEpsilon);
      for (int a = 0; a < 3; ++a) {
        difference[a] = values[int64_t{next[a]} * stride + index] - value;
        radicand += difference[a] * difference[a];
      }
      const T root = std::sqrt(radicand);
      sum += root;
      if (scale == 0) continue;
      T d_own = 0;
      for (int a = 0; a < 3; ++a) {
        if (next[a] == own || difference[a] == 0) continue;
        const T d = scale * difference[a] / root;
        add(next[a], d);
        d_own -= d;
      }
      if (d_own != 0) add(own, d_own);
    }
  }
  return sum;
}

}  // namespace regrade
