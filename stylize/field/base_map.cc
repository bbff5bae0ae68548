#include "stylize/field/base_map.h"

#include <algorithm>

#include "kernels/field/background_spheres.h"
#include "kernels/field/sample_basis.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

// The blend of coefficients [3, basis] at a sample of the box.
void BlendAt(const RadianceField& field, const WeightedSample& sample, float* sh) {
  const int stride = field.appearance.stride();
  int32_t points[8];
  CornerPoints(*field.geometry, sample, points);
  std::fill_n(sh, stride, 0.0f);
  for (int k = 0; k < 8; ++k) {
    if (points[k] < 0) continue;
    const float w = CornerWeight(sample.fraction, k);
    const float* const corner = field.appearance.sh.data() + int64_t{points[k]} * stride;
    for (int c = 0; c < stride; ++c) sh[c] += w * corner[c];
  }
}

Vec3f SphereColor(const RadianceField& field, const WeightedSample& sample) {
  const int64_t voxels = field.geometry->num_voxels();
  int32_t points[8];
  CornerPoints(*field.geometry, sample, points);
  float value[3] = {};
  for (int k = 0; k < 8; ++k) {
    if (points[k] < 0) continue;
    for (int c = 0; c < 3; ++c)
      value[c] += CornerWeight(sample.fraction, k) *
                  field.appearance.sphere_color[3 * (points[k] - voxels) + c];
  }
  return LayerColor(value);
}

}  // namespace

ColorMap LeastSquaresMap(const RadianceField& field, const StyleRays& batch,
                         const AggregationOptions& options, RayWeigher* weigher) {
  const int64_t n = batch.size();
  std::unique_ptr<RayWeigher> own;
  if (weigher == nullptr) {
    own = MakeRayWeigher(*field.geometry, field.near_clip, options.march, options.min_weight);
    weigher = own.get();
  }
  const RayWeights weights = weigher->Weigh(batch);
  const int basis = field.appearance.basis;
  std::vector<Vec3f> foreground(n);
#pragma omp parallel for schedule(dynamic, 64)
  for (int64_t r = 0; r < n; ++r) {
    SampleBasis<float> harmonics(basis, batch.rays[r].direction, weights);
    for (int64_t i = weights.first[r]; i < weights.first[static_cast<size_t>(r) + 1]; ++i) {
      const WeightedSample& sample = weights.samples[i];
      if (sample.on_sphere()) {
        foreground[r] += SphereColor(field, sample) * sample.weight;
        continue;
      }
      float sh[3 * kMaxBasis];
      BlendAt(field, sample, sh);
      const float* const gamma = harmonics.Of(i);
      for (int c = 0; c < 3; ++c) {
        float value = 0.5f;
        for (int k = 0; k < basis; ++k) value += sh[c * basis + k] * gamma[k];
        foreground[r][c] += sample.weight * std::max(value, 0.0f);
      }
    }
  }
  LeastSquaresAccumulator sum;
  for (int64_t r = 0; r < n; ++r) {
    const Vec3f& target = batch.targets[r];
    const float transmittance = weights.transmittance[r];
    if (!AllFinite(target) || transmittance > options.max_transmittance) continue;
    sum.Add(foreground[r].Cast<double>(),
            (target - field.background * transmittance).Cast<double>(), 1, 1 - transmittance);
  }
  return sum.Solve();
}

LipschitzNetwork NetworkOfMap(const ColorMap& map, int basis) {
  LipschitzNetwork network(basis);
  network.data().has_base = true;
  network.data().base = map;
  return network;
}

RowMap RowMapOf(const ColorMap& map) {
  const double zeros[3] = {};
  double of_zero[3];
  MapCoefficients(map, 1, zeros, of_zero);
  RowMap rows;
  for (int c = 0; c < 3; ++c) rows.matrix.row[c] = map.matrix.row[c].Cast<float>();
  rows.constant = Vec3d{of_zero[0], of_zero[1], of_zero[2]}.Cast<float>();
  return rows;
}

RowMap BaseOf(const LipschitzNetworkData& data) {
  if (data.has_base) return RowMapOf(data.base);
  return {.matrix = {.row = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}, .constant = {0, 0, 0}};
}

}  // namespace regrade
