// Photos are evidence of empty space: nothing opaque is between a camera and a point it saw.
//
// EQ(free-space): with tau_r the optical depth that an adaptive field has on ray r before the
// length l_r,
//   L = lambda mean_r (1 - exp(-tau_r)),   dL/dsigma_i = lambda / n exp(-tau_r) delta_i
// for the samples i before l_r. The loss is an opacity: it is bounded, so that a wrong point
// cannot outweigh what photos show. Depth from sparse points: Deng et al. 2022 (DS-NeRF), who
// fit the ray's whole weights to the point's depth; here only what is in front of it counts.
#pragma once

#include <cmath>

#include "kernels/field/cell_walk.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

// A ray that is free before `length` (world units; in device coordinates, of that space).
struct FreeRay {
  Ray ray;
  float length = 0;
};

// Calls body(sample, tau) for each cell whose sample is before `length` and has some opacity.
// density [V].
template <typename T, typename Body>
HD void WalkFreeSpace(const GridFrame& frame, const CellsView& cells, const T* density,
                      const RayT<T>& ray, T near_clip, T length, const Body& body) {
  WalkCells(frame, cells, ray, near_clip, [&](const CellSample<T>& sample) {
    if (!(sample.t < length)) return false;
    if (sample.cell == kNoCell) return true;
    T sigma = 0;
    for (int k = 0; k < 8; ++k)
      sigma += CornerWeight(sample.fraction, k) *
               density[cells.corner[8 * int64_t{sample.cell} + k]];
    const T tau = OpticalDepth(sigma, sample.delta);
    if (tau > 0) body(sample, tau);
    return true;
  });
}

// 1 - exp(-tau_r).
template <typename T>
HD T OpacityBefore(const GridFrame& frame, const CellsView& cells, const T* density,
                   const RayT<T>& ray, T near_clip, T length) {
  T depth = 0;
  WalkFreeSpace(frame, cells, density, ray, near_clip, length,
                [&](const CellSample<T>&, T tau) { depth += tau; });
  return Opacity(depth);
}

// Calls add(vertex, scale * d(OpacityBefore)/d(density)). A saturated sample has none, as in
// the adjoint of a ray's colour.
template <typename T, typename Add>
HD void OpacityBeforeAdjoint(const GridFrame& frame, const CellsView& cells, const T* density,
                             const RayT<T>& ray, T near_clip, T length, T opacity, T scale,
                             const Add& add) {
  const T slope = scale * (1 - opacity);
  WalkFreeSpace(frame, cells, density, ray, near_clip, length,
                [&](const CellSample<T>& sample, T tau) {
                  if (!(tau < T(kMaxOpticalDepth))) return;
                  for (int k = 0; k < 8; ++k)
                    add(cells.corner[8 * int64_t{sample.cell} + k],
                        slope * sample.delta * CornerWeight(sample.fraction, k));
                });
}

}  // namespace regrade
