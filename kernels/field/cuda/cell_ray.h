// One ray through an adaptive field in the packed layout, sample by sample: what a thread of
// the device does for a pixel. Host and device, so that tests need no GPU.
//
// EQ(vertex-colors): all rays of a frame begin at one point o, which sees a vertex v of the
// field in one direction d_v only. So its colour c_v = sum_j k_vj Gamma_j(d_v) + 1/2 is
// evaluated once a frame, and a sample takes the blend of its corners' colours instead of the
// colour of their blended coefficients at the ray's direction d. With weights w_v and k = sum_v
// w_v k_v,
//   sum_v w_v k_v . Gamma(d_v) - k . Gamma(d)
//     = sum_v w_v (k_v - k) . (Gamma(d_v) - Gamma(d)) + k . sum_v w_v (Gamma(d_v) - Gamma(d)),
// a product of two differences within a cell, and the curvature of Gamma across it: both fall
// with the square of the cell's width as seen from o.
#pragma once

#include <cmath>
#include <cstdint>

#include "kernels/field/cell_walk.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/direction_to_vertex.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {

// What one instruction of a device loads.
struct alignas(16) FourFloats {
  float of[4];
};
struct alignas(16) FourVertices {
  int32_t of[4];
};

// The colour before the clamp from the records of kCorners vertices; see EQ(sh-basis).
template <int kBasis, int kCorners>
HD Vec3f ColorOfRecords(const DeviceGridView& grid, const int32_t (&corner)[kCorners],
                        const float (&weight)[kCorners], const float (&basis)[kMaxVoxelBasis]) {
  constexpr int kUsed = 3 * kBasis;  // of a record's values; the density follows
  Vec3f raw{0.5f, 0.5f, 0.5f};
  for (int quad = 0; 4 * quad < kUsed; ++quad) {
    float sum[4] = {};
    for (int k = 0; k < kCorners; ++k) {
      const FourFloats values = *reinterpret_cast<const FourFloats*>(
          grid.records + corner[k] * grid.stride + 4 * quad);
      for (int i = 0; i < 4; ++i) sum[i] += weight[k] * values.of[i];
    }
    for (int i = 0; i < 4; ++i) {
      const int index = 4 * quad + i;
      if (index < kUsed) raw[index / kBasis] += basis[index % kBasis] * sum[i];
    }
  }
  return raw;
}

// A vertex's colour before the clamp as the camera sees it, and its density.
template <int kBasis>
HD FourFloats ColorOfVertex(const DeviceGridView& grid, const PinholeRays& camera, int32_t v) {
  float basis[kMaxVoxelBasis];
  ShBasis(kBasis, DirectionToVertex(grid.frame, grid.vertex_key[v], camera), basis);
  const int32_t corner[1] = {v};
  const float weight[1] = {1};
  const Vec3f raw = ColorOfRecords<kBasis>(grid, corner, weight, basis);
  return {{raw.x, raw.y, raw.z, grid.dense_density[v]}};
}

struct CellRaySums {
  Vec3f color{};  // not clipped, with the background behind the last sample
  float depth = 0;
  float transmittance = 1;
};

// `colors` [V]: see EQ(vertex-colors); of the camera that the ray comes from. A sample takes
// the coefficients of its corners instead where its cell, of n voxels, is wide: at ray lengths
// below n * wide_until (world units); and everywhere without kColors.
template <int kBasis, bool kColors>
HD CellRaySums RenderCellRay(const DeviceGridView& grid, const Ray& ray,
                             const FourFloats* colors, float wide_until, float stop) {
  float basis[kMaxVoxelBasis];
  ShBasis(kBasis, ray.direction, basis);
  CellRaySums sums;
  float optical_depth = 0;
  WalkCells(grid.frame, grid.cells, ray, grid.near_clip, [&](const CellSample<float>& sample) {
    if (sample.cell == kNoCell) return true;
    const auto* corners =
        reinterpret_cast<const FourVertices*>(grid.cells.corner + int64_t{8} * sample.cell);
    const FourVertices low = corners[0], high = corners[1];
    const int32_t corner[8] = {low.of[0],  low.of[1],  low.of[2],  low.of[3],
                               high.of[0], high.of[1], high.of[2], high.of[3]};
    float weight[8];
    for (int k = 0; k < 8; ++k) weight[k] = CornerWeight(sample.fraction, k);
    Vec3f raw{};
    float density = 0;
    for (int k = 0; k < 8; ++k) {
      if constexpr (kColors) {
        const FourFloats values = colors[corner[k]];
        for (int c = 0; c < 3; ++c) raw[c] += weight[k] * values.of[c];
        density += weight[k] * values.of[3];
      } else {
        density += weight[k] * grid.dense_density[corner[k]];
      }
    }
    const float tau = OpticalDepth(density, sample.delta);
    if (!(tau > 0)) return true;
    if (!kColors || static_cast<float>(sample.width) * wide_until > sample.t)
      raw = ColorOfRecords<kBasis>(grid, corner, weight, basis);
    const float w = sums.transmittance * Opacity(tau);
    for (int c = 0; c < 3; ++c) sums.color[c] += w * (raw[c] > 0 ? raw[c] : 0.0f);
    sums.depth += w * sample.t;
    optical_depth += tau;
    sums.transmittance = std::exp(-optical_depth);
    return !(sums.transmittance < stop);
  });
  sums.color += grid.background * sums.transmittance;
  return sums;
}

}  // namespace regrade
