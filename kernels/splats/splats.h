// Splats: 3D Gaussians with an opacity and a colour that depends on the direction, in one array
// for each attribute.
//
// Which values are used: a splat is left out of every picture unless all its values are finite,
// its mean's coordinates are at most kMaxCoordinate and its colour's coefficients at most
// kMaxCoefficient. Files with such splats are refused; a fit may make one.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/base/vec.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

inline constexpr double kMaxCoordinate = 1e30;  // world units: squares are finite in double
inline constexpr double kMaxCoefficient = 1e6;

// What defines a Gaussian; its colour is apart.
template <typename T>
struct Splat {
  Vec3<T> mean;       // world
  Vec3<T> log_scale;  // logarithms of the standard deviations along its axes, world units
  T quaternion[4]{};  // w, x, y, z: world from the splat's axes; any length
  T opacity_logit{};
};

template <typename T>
struct SplatsView {
  const T* mean = nullptr;           // [N, 3]
  const T* log_scale = nullptr;      // [N, 3]
  const T* quaternion = nullptr;     // [N, 4]
  const T* opacity_logit = nullptr;  // [N]
  const T* sh = nullptr;             // [N, 3, basis]: all coefficients of red first
  int64_t count = 0;
  int basis = 1;
  Vec3<T> background{};

  HD Splat<T> operator[](int64_t i) const {
    return {{mean[3 * i], mean[3 * i + 1], mean[3 * i + 2]},
            {log_scale[3 * i], log_scale[3 * i + 1], log_scale[3 * i + 2]},
            {quaternion[4 * i], quaternion[4 * i + 1], quaternion[4 * i + 2],
             quaternion[4 * i + 3]},
            opacity_logit[i]};
  }
  HD const T* Coefficients(int64_t i) const { return sh + 3 * basis * i; }
};

// Splats, or a gradient by them.
template <typename T>
struct SplatArrays {
  std::vector<T> mean, log_scale, quaternion, opacity_logit, sh;  // shapes: see SplatsView
  int basis = 1;                                                  // 1, 4, 9 or 16
  Vec3<T> background{};                                           // sRGB

  SplatArrays() = default;
  // `count` splats of zeros.
  SplatArrays(int64_t count, int basis)
      : mean(static_cast<size_t>(3 * count)),
        log_scale(static_cast<size_t>(3 * count)),
        quaternion(static_cast<size_t>(4 * count)),
        opacity_logit(static_cast<size_t>(count)),
        sh(static_cast<size_t>(3 * basis * count)),
        basis(basis) {}

  // Everything but the colour.
  void Set(int64_t i, const Splat<T>& splat) {
    for (int a = 0; a < 3; ++a) {
      mean[static_cast<size_t>(3 * i + a)] = splat.mean[a];
      log_scale[static_cast<size_t>(3 * i + a)] = splat.log_scale[a];
    }
    for (int a = 0; a < 4; ++a)
      quaternion[static_cast<size_t>(4 * i + a)] = splat.quaternion[a];
    opacity_logit[static_cast<size_t>(i)] = splat.opacity_logit;
  }
  int64_t count() const { return static_cast<int64_t>(opacity_logit.size()); }
  SplatsView<T> view() const {
    return {mean.data(),
            log_scale.data(),
            quaternion.data(),
            opacity_logit.data(),
            sh.data(),
            count(),
            basis,
            background};
  }
};
using Splats = SplatArrays<float>;

// Appends those splats of `from` for whose index `take` is true. Both have the same basis.
template <typename Take>
void AppendSplats(const SplatsView<float>& from, const Take& take, Splats* to) {
  const auto append = [](const float* values, int64_t i, int64_t each,
                         std::vector<float>* into) {
    into->insert(into->end(), values + each * i, values + each * (i + 1));
  };
  for (int64_t i = 0; i < from.count; ++i) {
    if (!take(i)) continue;
    append(from.mean, i, 3, &to->mean);
    append(from.log_scale, i, 3, &to->log_scale);
    append(from.quaternion, i, 4, &to->quaternion);
    append(from.opacity_logit, i, 1, &to->opacity_logit);
    append(from.sh, i, 3 * from.basis, &to->sh);
  }
}

inline void AppendSplats(const SplatsView<float>& from, Splats* to) {
  AppendSplats(
      from, [](int64_t) { return true; }, to);
}

// Whether splat i may be in a picture.
template <typename T>
HD bool IsUsable(const SplatsView<T>& splats, int64_t i) {
  using std::abs, std::isfinite;
  const auto within = [](T value, double most) { return abs(value) <= T(most); };
  const Splat<T> splat = splats[i];
  for (int a = 0; a < 3; ++a)
    if (!within(splat.mean[a], kMaxCoordinate) || !isfinite(splat.log_scale[a])) return false;
  for (int a = 0; a < 4; ++a)
    if (!isfinite(splat.quaternion[a])) return false;
  for (int k = 0; k < 3 * splats.basis; ++k)
    if (!within(splats.Coefficients(i)[k], kMaxCoefficient)) return false;
  return isfinite(splat.opacity_logit);
}

// Throws InputError naming the defect: sizes that disagree, a basis that does not exist, splats
// that are not usable, a background that is not finite.
void Validate(const Splats& splats, const char* name);

}  // namespace regrade
