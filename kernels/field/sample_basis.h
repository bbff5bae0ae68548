// The harmonics at which the samples of a ray have their colours.
#pragma once

#include "kernels/field/ray_weights.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

// Gamma(d), see EQ(sh-basis): d is the ray's direction, of splats each sample's own. Harmonics
// beyond `basis` are 0.
template <typename T>
class SampleBasis {
 public:
  // `weights` must outlive it.
  SampleBasis(int basis, const Vec3<T>& ray_direction, const RayWeights& weights)
      : basis_(basis),
        directions_(weights.directions.empty() ? nullptr : weights.directions.data()) {
    if (directions_ == nullptr) ShBasis(basis, ray_direction, gamma_);
  }

  // [kMaxBasis], of sample i of all rays; valid until the next call.
  const T* Of(int64_t i) {
    if (directions_ != nullptr) ShBasis(basis_, directions_[i].Cast<T>(), gamma_);
    return gamma_;
  }

 private:
  int basis_;
  const Vec3f* directions_;
  T gamma_[kMaxBasis] = {};
};

}  // namespace regrade
