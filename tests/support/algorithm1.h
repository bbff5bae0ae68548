// LipRF's Algorithm 1 to the letter, for any scalar: every voxel of the field goes through f.
// The specification that gradient_aggregation.h is held to; see EQ(liprf-loss) there.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "kernels/field/ray_weights.h"
#include "kernels/field/sample_basis.h"
#include "kernels/field/trilinear.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/view_penalty.h"
#include "tests/support/record_error.h"
#include "tests/support/styled_ball.h"

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

namespace testing {

inline std::vector<double> NoGradient(int basis = 9) {
  return std::vector<double>(static_cast<size_t>(LipschitzNetwork(basis).NumParameters()));
}

// Algorithm 1's loss and its gradient by the network's own parameters.
inline double PlainGradient(const LipschitzNetwork& network, const RadianceField& field,
                            const RayWeights& weights, const StyleRays& batch, double scale,
                            double view_weight, std::vector<double>* gradient) {
  std::vector<Vec3d> directions, targets;  // samples of splats have their own directions
  for (size_t r = 0; r < batch.targets.size(); ++r) {
    directions.push_back(batch.rays.empty() ? Vec3d{} : batch.rays[r].direction.Cast<double>());
    targets.push_back(batch.targets[r].Cast<double>());
  }
  DenseNetwork<double> d_effective;
  for (int l = 0; l < kNetworkLayers; ++l)
    d_effective.layers.emplace_back(network.Outputs(l), network.Inputs(l));
  const double loss = Algorithm1<double>(network, field, weights, directions, targets, scale,
                                         view_weight, &d_effective);
  if (gradient != nullptr) network.AddGradient(d_effective, gradient);
  return loss;
}

// That gradient against differences in steps of 2^step and smaller ones, for some of every
// layer's W, b and K; u and v stay, as in the adjoint.
inline void ExpectRichardson(LipschitzNetwork network, const RadianceField& field,
                             const RayWeights& weights, const StyleRays& batch, int step,
                             const std::string& what) {
  const auto loss = [&](std::vector<double>* gradient) {
    return PlainGradient(network, field, weights, batch, 1.0, 0.7, gradient);
  };
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t first = network.weight(l) - network.weight(0);
    const int64_t bias = network.bias(l) - network.weight(0);
    const int64_t k = &network.k(l) - network.weight(0);
    for (const int64_t at : {first, first + 37, bias + 3, k}) {
      // Parameters are float: steps are powers of two, so that both ends are exact.
      float& value = network.data().parameters[static_cast<size_t>(at)];
      const float before = value = std::ldexp(std::round(std::ldexp(value, 14)), -14);
      std::vector<double> analytic = NoGradient(network.row().basis);
      loss(&analytic);
      const auto central = [&](int exponent) {
        const float h = std::ldexp(1.0f, exponent);
        value = before + h;
        const double plus = loss(nullptr);
        value = before - h;
        const double minus = loss(nullptr);
        value = before;
        return (plus - minus) / (2 * static_cast<double>(h));
      };
      // Two Richardson steps: error O(h^6).
      const double h0 = central(step), h1 = central(step - 1), h2 = central(step - 2);
      const double r0 = (4 * h1 - h0) / 3, r1 = (4 * h2 - h1) / 3;
      const double numeric = (16 * r1 - r0) / 15, is = analytic[static_cast<size_t>(at)];
      EXPECT_NEAR(is, numeric,
                  RecordDigits(what, Computed::kDouble, is - numeric, 2e-8,
                               std::max(1.0, std::abs(numeric))))
          << "layer " << l << " parameter " << at - first;
    }
  }
}

}  // namespace testing

}  // namespace regrade
