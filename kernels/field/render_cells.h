// One ray through an adaptive field, forward and adjoint: the plain specification. The march is
// in cell_walk.h.
#pragma once

#include <vector>

#include "kernels/field/cell_walk.h"
#include "kernels/field/density_losses.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

// The trilinear blend of the values [V, stride] at a cell's corners; EQ(trilinear) without
// empty corners.
template <typename T>
HD void InterpolateInCell(const CellsView& cells, const CellSample<T>& sample, const T* values,
                          int stride, int channels, T* out) {
  for (int c = 0; c < channels; ++c) out[c] = T(0);
  for (int k = 0; k < 8; ++k) {
    const T* v = values + int64_t{cells.corner[8 * int64_t{sample.cell} + k]} * stride;
    const T w = CornerWeight(sample.fraction, k);
    for (int c = 0; c < channels; ++c) out[c] += w * v[c];
  }
}

template <typename T, typename Add>
HD void InterpolateInCellAdjoint(const CellsView& cells, const CellSample<T>& sample,
                                 int stride, int channels, const T* d_out, T* d_values,
                                 const Add& add) {
  for (int k = 0; k < 8; ++k) {
    T* d_v = d_values + int64_t{cells.corner[8 * int64_t{sample.cell} + k]} * stride;
    const T w = CornerWeight(sample.fraction, k);
    for (int c = 0; c < channels; ++c) add(&d_v[c], w * d_out[c]);
  }
}

// A sample that composites.
template <typename T>
struct CompositedCell {
  CellSample<T> place;
  T density, tau, transmittance_before;
};

// The samples of a ray that composite, front to back, up to the one that leaves less than
// `stop`; returns the transmittance behind them.
template <typename T>
T MarchCells(const GridFrame& frame, const CellsView& cells, const T* density,
             const RayT<T>& ray, T near_clip, T stop, std::vector<CompositedCell<T>>* samples) {
  samples->clear();
  T depth = 0, transmittance = 1;
  CellPath cell_at(cells);
  WalkCellsFoundBy(frame, cell_at, ray, near_clip, [&](const CellSample<T>& place) {
    if (place.cell == kNoCell) return true;
    T sigma;
    InterpolateInCell(cells, place, density, 1, 1, &sigma);
    const T tau = OpticalDepth(sigma, place.delta);
    if (!(tau > 0)) return true;
    samples->push_back({place, sigma, tau, transmittance});
    depth += tau;
    transmittance = std::exp(-depth);
    return !(transmittance < stop);
  });
  return transmittance;
}

// Colour before the clamp at 0 [3]; `gamma` of EQ(sh-basis).
template <typename T>
Vec3<T> RawColorInCell(const FieldView<T>& field, const CellSample<T>& place, const T* gamma) {
  T sh[3 * kMaxBasis];
  const int stride = 3 * field.basis;
  InterpolateInCell(field.cells, place, field.sh, stride, stride, sh);
  Vec3<T> raw;
  for (int c = 0; c < 3; ++c) {
    raw[c] = T(0.5);
    for (int k = 0; k < field.basis; ++k) raw[c] += sh[c * field.basis + k] * gamma[k];
  }
  return raw;
}

template <typename T>
Vec3<T> ClampedColor(const Vec3<T>& raw) {
  return {raw.x > 0 ? raw.x : T(0), raw.y > 0 ? raw.y : T(0), raw.z > 0 ? raw.z : T(0)};
}

// Colour and depth of the composited samples, without what is behind them; depth is sum w t in
// world units.
template <typename T>
Vec3<T> ShadeCells(const FieldView<T>& field, const RayT<T>& ray,
                   const std::vector<CompositedCell<T>>& samples, T* depth) {
  T gamma[kMaxBasis];
  ShBasis(field.basis, ray.direction, gamma);
  Vec3<T> color{};
  *depth = 0;
  for (const CompositedCell<T>& s : samples) {
    const T w = s.transmittance_before * Opacity(s.tau);
    color += ClampedColor(RawColorInCell(field, s.place, gamma)) * w;
    *depth += w * s.place.t;
  }
  return color;
}

// Adds dL/d(density) and dL/d(sh) for dL/dC = d_color; `behind` is the radiance behind the
// samples. See EQ(composite-adjoint).
template <typename T, typename Add>
void ShadeCellsAdjoint(const FieldView<T>& field, const RayT<T>& ray,
                       const std::vector<CompositedCell<T>>& samples, Vec3<T> behind,
                       const Vec3<T>& d_color, T* d_density, T* d_sh, const Add& add,
                       const DensityLosses& losses = {}) {
  const T remaining = samples.empty()
                          ? T(1)
                          : samples.back().transmittance_before * std::exp(-samples.back().tau);
  T gamma[kMaxBasis];
  ShBasis(field.basis, ray.direction, gamma);
  const int stride = 3 * field.basis;
  for (size_t i = samples.size(); i-- > 0;) {
    const CompositedCell<T>& s = samples[i];
    const T delta = s.place.delta;
    const Vec3<T> raw = RawColorInCell(field, s.place, gamma);
    const T w = s.transmittance_before * Opacity(s.tau);
    T d_sigma = CompositeAdjoint(delta, s.tau, s.transmittance_before * std::exp(-s.tau),
                                 ClampedColor(raw), d_color, &behind) +
                DensityLossSlope(losses, remaining, s.density, delta);
    if (!(s.density < T(kMaxDensity)) || !(s.density * delta < T(kMaxOpticalDepth)))
      d_sigma = 0;
    T d_sample[3 * kMaxBasis];
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < field.basis; ++k)  // subgradient 0 of the clamp
        d_sample[c * field.basis + k] = raw[c] > 0 ? w * d_color[c] * gamma[k] : T(0);
    InterpolateInCellAdjoint(field.cells, s.place, 1, 1, &d_sigma, d_density, add);
    InterpolateInCellAdjoint(field.cells, s.place, stride, stride, d_sample, d_sh, add);
  }
}

}  // namespace regrade
