// The colour of a ray from the rows of the points that its samples blend, and the adjoint.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "kernels/field/ray_weights.h"
#include "kernels/field/sample_basis.h"
#include "kernels/field/trilinear.h"
#include "stylize/field/network_row.h"

namespace regrade {

// What is known when the loss is compiled: how many points a sample blends, and their rows.
template <int kCornersOf, int kBasisOf>
struct StyledShape {
  static constexpr int kCorners = kCornersOf, kBasis = kBasisOf;
  static constexpr NetworkRow kRow{kBasis};
  static constexpr int kStride = kRow.stride();
  // Background spheres have plain colours.
  static int TermsOf(const WeightedSample& sample) { return sample.on_sphere() ? 1 : kBasis; }
};

// Calls body(StyledShape) for the field's; voxels have no more than nine harmonics.
template <typename Body>
auto ByShape(int corners, const NetworkRow& row, const Body& body) {
  if (corners == 8) return body(StyledShape<8, kMaxVoxelBasis>());
  return row.basis == kMaxBasis ? body(StyledShape<1, kMaxBasis>())
                                : body(StyledShape<1, kMaxVoxelBasis>());
}

// Samples of one ray.
struct StyledRay {
  const RayWeights& weights;
  int64_t first, n;      // samples
  const int32_t* slots;  // of all samples
  SampleBasis<float> basis;

  StyledRay(const RayWeights& weights, const std::vector<int32_t>& slots, int64_t ray,
            int basis, const Vec3f& direction)
      : weights(weights),
        first(weights.first[static_cast<size_t>(ray)]),
        n(weights.first[static_cast<size_t>(ray) + 1] - first),
        slots(slots.data()),
        basis(basis, direction, weights) {}
};

// Colours of a ray before the background, and which channels of which samples the clamp left
// unclamped.
template <typename Shape>
Vec3f RenderStyled(StyledRay* ray, const float* sh, uint8_t* unclamped) {
  Vec3f color{0, 0, 0};
  for (int64_t i = ray->first; i < ray->first + ray->n; ++i) {
    const WeightedSample& sample = ray->weights.samples[static_cast<size_t>(i)];
    float blend[Shape::kStride] = {};
    for (int corner = 0; corner < Shape::kCorners; ++corner) {
      const int32_t slot = ray->slots[i * Shape::kCorners + corner];
      if (slot < 0) continue;
      const float w = CornerWeight(sample.fraction, corner);
      const float* row = sh + static_cast<int64_t>(slot) * Shape::kStride;
      for (int l = 0; l < Shape::kStride; ++l) blend[l] += w * row[l];
    }
    const int terms = Shape::TermsOf(sample);
    const float* const gamma = ray->basis.Of(i);
    uint8_t bits = 0;
    for (int c = 0; c < 3; ++c) {
      float value = 0.5f;
      for (int k = 0; k < terms; ++k) value += blend[c * Shape::kBasis + k] * gamma[k];
      if (!(value > 0)) continue;
      bits = static_cast<uint8_t>(bits | (1 << c));
      color[c] += sample.weight * value;
    }
    unclamped[i] = bits;
  }
  return color;
}

// dL/d(blend) where no channel is clamped, without w_i, and 1 in the lanes of masses.
template <typename Shape>
void BlendAdjoint(const Vec3f& d_color, const float* gamma, float* d_blend) {
  constexpr int kBasis = Shape::kBasis;
  std::fill_n(d_blend, Shape::kStride, 0.0f);
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < kBasis; ++k) d_blend[c * kBasis + k] = d_color[c] * gamma[k];
  std::fill_n(d_blend + Shape::kRow.mass(), 3, 1.0f);
}

// Adds the adjoint of RenderStyled to the rows of d_sh in [begin, end), and the masses of
// EQ(view-penalty).
template <typename Shape>
void ScatterStyled(StyledRay* ray, const uint8_t* unclamped, const Vec3f& d_color,
                   int32_t begin, int32_t end, float* d_sh) {
  constexpr int kCorners = Shape::kCorners, kBasis = Shape::kBasis, kStride = Shape::kStride;
  float d_blend[kStride];
  const float* gamma = nullptr;
  const bool own = !ray->weights.directions.empty();  // directions of samples
  for (int64_t i = ray->first; i < ray->first + ray->n; ++i) {
    const uint8_t bits = unclamped[i];
    if (bits == 0) continue;
    const int32_t* const slots = ray->slots + i * kCorners;
    if (kCorners == 1 && (slots[0] < begin || slots[0] >= end)) continue;
    const WeightedSample& sample = ray->weights.samples[static_cast<size_t>(i)];
    if (gamma == nullptr || own)
      BlendAdjoint<Shape>(d_color, gamma = ray->basis.Of(i), d_blend);
    float masked[kStride];
    const float* d = d_blend;
    const int terms = Shape::TermsOf(sample);
    if (bits != 7 || terms != kBasis) {
      std::copy_n(d_blend, kStride, masked);
      for (int c = 0; c < 3; ++c) {
        const bool is_unclamped = (bits & (1 << c)) != 0;
        const int kept = is_unclamped ? terms : 0;
        std::fill_n(masked + c * kBasis + kept, kBasis - kept, 0.0f);
        if (kept < kBasis) masked[Shape::kRow.mass() + c] = 0;
      }
      d = masked;
    }
    for (int corner = 0; corner < kCorners; ++corner) {
      const int32_t slot = slots[corner];
      if (slot < begin || slot >= end) continue;
      const float w = sample.weight * CornerWeight(sample.fraction, corner);
      float* row = d_sh + static_cast<int64_t>(slot) * kStride;
      for (int l = 0; l < kStride; ++l) row[l] += w * d[l];
    }
  }
}

}  // namespace regrade
