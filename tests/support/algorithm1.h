// LipRF's Algorithm 1 to the letter, for any scalar: every voxel of the field goes through f.
// The specification that gradient_aggregation.h is held to; see EQ(liprf-loss) there.
#pragma once

#include <algorithm>
#include <vector>

#include "kernels/field/ray_weights.h"
#include "kernels/field/sample_basis.h"
#include "kernels/field/trilinear.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/view_penalty.h"

namespace regrade {

// L_rec = scale * sum over rays and channels of squared differences, and view_weight times
// EQ(view-penalty) with `scale` for 1 / (3 Q), and the gradient by the effective matrices added
// to `d_effective`. `weights` belong to the rays; directions and targets are [rays]. Not
// one-sided; every ray counts.
template <typename T>
T Algorithm1(const LipschitzNetwork& network, const RadianceField& field,
             const RayWeights& weights, const std::vector<Vec3<T>>& directions,
             const std::vector<Vec3<T>>& targets, T scale, T view_weight,
             DenseNetwork<T>* d_effective) {
  const Geometry& geometry = *field.geometry;
  const std::vector<int32_t> vertex = VertexOfVoxel(geometry);
  const DenseNetwork<T> f = network.Effective<T>();
  const std::vector<int32_t> place = PlaceOfColumn(geometry.spheres);
  const int64_t voxels = geometry.num_voxels(), n = voxels + geometry.spheres.num_texels();

  const NetworkRow row_of = network.row();
  const int harmonics = row_of.basis, terms = row_of.sh();

  // 0. feed forward
  std::vector<T> features(static_cast<size_t>(n) * row_of.inputs());
  std::vector<T> sh(static_cast<size_t>(n) * terms), change(sh.size()), d_sh(sh.size());
  std::vector<T> mass(static_cast<size_t>(n) * 3);  // see EQ(view-penalty)
  for (int64_t v = 0; v < n; ++v) {
    float row[kLargestRow.stride()];
    if (v < voxels)
      FillFeatures(field, network.data().position_scale, v, vertex[v], row);
    else
      FillTexelFeatures(field, network.data().position_scale, v - voxels,
                        place[(v - voxels) / geometry.spheres.layers], row);
    T* x = &features[static_cast<size_t>(v) * row_of.inputs()];
    std::copy_n(row, row_of.inputs(), x);
    T* y = &sh[static_cast<size_t>(v) * terms];
    DenseForward(f, x, y);
    std::copy_n(y, terms, &change[static_cast<size_t>(v) * terms]);
    if (network.data().has_base) AddBaseMap(network.data().base, network.row().basis, x, y);
  }

  // 1. from the loss to the image, and 2. from the image to the coefficients
  T loss = 0;
  for (int64_t r = 0; r < weights.num_rays(); ++r) {
    SampleBasis<T> basis(field.appearance.basis, directions[r], weights);
    const int64_t first = weights.first[r];
    const int64_t last = weights.first[static_cast<size_t>(r) + 1];
    std::vector<Vec3<T>> raw(last - first);
    Vec3<T> color = field.background.Cast<T>() * T(weights.transmittance[r]);
    for (int64_t i = first; i < last; ++i) {
      const WeightedSample& sample = weights.samples[i];
      const Vec3<T> fraction = sample.fraction.Cast<T>();
      int32_t points[8];
      CornerPoints(geometry, sample, points);
      const T* const gamma = basis.Of(i);
      T blend[kLargestRow.sh()] = {};
      for (int corner = 0; corner < 8; ++corner)
        for (int k = 0; k < terms && points[corner] >= 0; ++k)
          blend[k] += CornerWeight(fraction, corner) *
                      sh[static_cast<size_t>(points[corner]) * terms + static_cast<size_t>(k)];
      for (int c = 0; c < 3; ++c) {
        T value = T(0.5);
        for (int k = 0; k < (sample.on_sphere() ? 1 : harmonics); ++k)
          value += blend[c * harmonics + k] * gamma[k];
        raw[i - first][c] = value;
        color[c] += T(sample.weight) * std::max(value, T(0));
      }
    }
    const Vec3<T> difference = color - targets[r];
    loss += scale * Dot(difference, difference);
    for (int64_t i = first; i < last; ++i) {
      const WeightedSample& sample = weights.samples[i];
      const Vec3<T> fraction = sample.fraction.Cast<T>();
      const T* const gamma = basis.Of(i);
      int32_t points[8];
      CornerPoints(geometry, sample, points);
      for (int c = 0; c < 3; ++c) {
        if (!(raw[i - first][c] > 0)) continue;
        for (int corner = 0; corner < 8; ++corner)
          if (points[corner] >= 0 && !sample.on_sphere())
            mass[static_cast<size_t>(points[corner]) * 3 + static_cast<size_t>(c)] +=
                T(sample.weight) * CornerWeight(fraction, corner);
        for (int k = 0; k < (sample.on_sphere() ? 1 : harmonics); ++k) {
          const T d_blend = 2 * scale * difference[c] * T(sample.weight) * gamma[k];
          for (int corner = 0; corner < 8; ++corner)
            if (points[corner] >= 0)
              d_sh[static_cast<size_t>(points[corner]) * terms +
                   static_cast<size_t>(c * harmonics + k)] +=
                  CornerWeight(fraction, corner) * d_blend;
        }
      }
    }
  }

  // and what changes with the direction
  for (size_t i = 0; i < sh.size(); ++i) {
    const size_t channel = i / static_cast<size_t>(harmonics);
    if (i % static_cast<size_t>(harmonics) == 0) continue;
    const ViewPenalty<T> penalty = ViewPenaltyOf(mass[channel], change[i]);
    loss += scale * view_weight * penalty.value;
    d_sh[i] += scale * view_weight * penalty.derivative;
  }

  // 3. from the coefficients to f
  for (int64_t v = 0; v < n; ++v)
    DenseAdjoint(f, &features[static_cast<size_t>(v) * row_of.inputs()],
                 &d_sh[static_cast<size_t>(v) * terms], d_effective, static_cast<T*>(nullptr));
  return loss;
}

}  // namespace regrade
