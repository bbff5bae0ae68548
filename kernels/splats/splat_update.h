// One optimizer step of a splat, the same body on both processors.
//
// EQ(splat-adam): Adam (see EQ(adam); epsilon 1e-15) on every value of a splat, with a rate for
// each attribute, that of means times max(1, |mean - middle| / reach), so that far splats move
// as far in pictures as near ones; on the gradient of the picture's loss and of
// EQ(splat-regularizers), Kheradmand et al. 2024, eq. 10:  lambda_o mean sigmoid(x_i) +
// lambda_s mean exp(l_ik)  over all splats.
//
// EQ(splat-color-bound): after the step, a coefficient of degree 0 is projected into
// [-mean_bound, mean_bound], by default a mean colour in [0, 1], and every other one into
// [-view_bound, view_bound]. What a colour's clamp or the splats before it hide, a style's map
// of colours would reveal.
//
// EQ(splat-noise), Kheradmand et al. 2024, eq. 8: after the step, with the covariance Sigma of
// EQ(splat-covariance) and n ~ N(0, 1)^3,
//   mean += noise Sigma n / (1 + exp(100 (o - 0.005))),
// which explores with splats that are nearly transparent, along their own extent, and leaves
// others: beyond o = 0.25, where the factor is below 1e-10, nothing is added.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/optimize/adam.h"
#include "kernels/splats/covariance.h"
#include "kernels/splats/extent.h"
#include "kernels/splats/splats.h"

namespace regrade {

inline constexpr float kDeadOpacity = 0.005f;  // below it, a splat is moved elsewhere
inline constexpr float kNoiseOpacity = 0.25f;  // from it on, none is added

struct SplatRates {
  float mean = 0;  // world units, within `reach` of `middle`
  float log_scale = 0, quaternion = 0, opacity_logit = 0;
  float sh_mean = 0, sh_rest = 0;  // of degree 0, and of the others
  Vec3f middle{0, 0, 0};
  float reach = std::numeric_limits<float>::infinity();

  HD float MeanAt(const float* place) const {
    const Vec3f away = Vec3f{place[0], place[1], place[2]} - middle;
    const float far = Norm(away) / reach;
    return far > 1 ? mean * far : mean;
  }
};

// Where means may be: world, low <= mean < high. A step that leaves it moves nothing.
struct SplatHold {
  Vec3f low{-kUnbounded, -kUnbounded, -kUnbounded}, high{kUnbounded, kUnbounded, kUnbounded};
  static constexpr float kUnbounded = std::numeric_limits<float>::infinity();

  HD bool Contains(const float* mean) const {
    for (int a = 0; a < 3; ++a)
      if (!(mean[a] >= low[a] && mean[a] < high[a])) return false;
    return true;
  }
};

struct SplatUpdate {
  SplatRates rates;
  int64_t frozen = 0;  // the splats before it stay as they are
  SplatHold hold;
  // Of splats that no photo has changed since they were made or copied, the regularizers count
  // nothing. Alone they are steps of full size, since Adam divides by their own square: where
  // each photo sees few of all splats, new ones would fade before one sees them (a street of
  // 120 photos: 17.1 instead of 23.6 dB).
  bool spare_unseen = false;
  float opacity_weight = 0, scale_weight = 0;         // the lambdas over the numbers of values
  float noise = 0;                                    // of EQ(splat-noise)
  float mean_bound = 1.77245385f, view_bound = 0.2f;  // sqrt(pi) = 1 / (2 kSh0)
  uint64_t seed = 0, step = 0;                        // steps before this one
  // Of Adam, for this step: see AdamUpdate.
  float beta1 = 0.9f, beta2 = 0.999f, epsilon = 1e-15f;
  float inverse_correction1 = 1, inverse_correction2 = 1;

  HD void Step(float gradient, float rate, float* value, float* first, float* second) const {
    AdamUpdate(gradient, beta1, beta2, epsilon, rate * inverse_correction1, inverse_correction2,
               value, first, second);
  }

  HD static void Bound(float bound, float* value) {
    *value = *value > bound ? bound : *value < -bound ? -bound : *value;
  }

  // Adam's moments were 0 at the step `from`.
  void SetStep(uint64_t number, uint64_t from = 0) {
    step = number;
    const int64_t t = static_cast<int64_t>(number - from) + 1;
    inverse_correction1 = static_cast<float>(1 / AdamBiasCorrection(double{beta1}, t));
    inverse_correction2 = static_cast<float>(1 / AdamBiasCorrection(double{beta2}, t));
  }
};

// The arrays of splats, or of a moment of their gradients, for writing; see SplatsView.
struct SplatPointers {
  float *mean, *log_scale, *quaternion, *opacity_logit, *sh;
};
struct SplatMoments {
  SplatPointers value, first, second;
};

// n ~ N(0, 1), three of them for splat i: Box and Muller on numbers by counter.
HD inline Vec3f SplatNoise(uint64_t seed, uint64_t step, int64_t i) {
  using std::cos, std::log, std::sin, std::sqrt;
  float uniform[4];
  for (uint64_t k = 0; k < 2; ++k) {
    const uint64_t bits =
        RandomBits(seed ^ kRandomSplatNoise, step, 2 * static_cast<uint64_t>(i) + k);
    // In (0, 1): half a step above multiples of 2^-24.
    uniform[2 * k] = (static_cast<float>(bits >> 40) + 0.5f) * 0x1p-24f;
    uniform[2 * k + 1] = static_cast<float>((bits >> 8) & 0xFFFFFF) * 0x1p-24f;
  }
  constexpr float kTurn = 6.28318531f;
  const float near = sqrt(-2 * log(uniform[0])), far = sqrt(-2 * log(uniform[2]));
  return {near * cos(kTurn * uniform[1]), near * sin(kTurn * uniform[1]),
          far * cos(kTurn * uniform[3])};
}

HD inline void AddSplatNoise(const SplatUpdate& update, int64_t i, const Splat<float>& splat,
                             float* mean) {
  using std::exp;
  const float opacity = exp(LogSigmoid(splat.opacity_logit));
  if (!(update.noise > 0) || !(opacity < kNoiseOpacity)) return;
  const float share = 1 / (1 + exp(100 * (opacity - kDeadOpacity)));
  const Mat3f rotation = RotationOf(splat.quaternion);
  const Vec3f scale = ScalesOf(splat.log_scale);
  Vec3f along = rotation.Transposed() * SplatNoise(update.seed, update.step, i);
  for (int a = 0; a < 3; ++a) along[a] *= scale[a] * scale[a];
  const Vec3f offset = rotation * along * (update.noise * share);
  for (int a = 0; a < 3; ++a) mean[a] += offset[a];
}

// Steps everything but the colour of splat i by the gradient d of the picture's loss. A
// gradient that is not finite, or whose square is not, changes nothing, and the result is
// false.
HD inline bool UpdateShape(const SplatUpdate& update, int64_t i, const Splat<float>& d,
                           const SplatMoments& to) {
  using std::abs, std::exp;
  float sum = abs(d.opacity_logit);
  for (int a = 0; a < 3; ++a) sum += abs(d.mean[a]) + abs(d.log_scale[a]);
  for (int a = 0; a < 4; ++a) sum += abs(d.quaternion[a]);
  if (!(sum < kLargestGradient)) return false;
  const auto step = [&](float gradient, float rate, int64_t k, float* SplatPointers::*of) {
    update.Step(gradient, rate, to.value.*of + k, to.first.*of + k, to.second.*of + k);
  };
  const SplatRates& rates = update.rates;
  const float before[3] = {to.value.mean[3 * i], to.value.mean[3 * i + 1],
                           to.value.mean[3 * i + 2]};
  const bool spared = update.spare_unseen && sum == 0 && to.second.opacity_logit[i] == 0;
  const float opacity_weight = spared ? 0 : update.opacity_weight,
              scale_weight = spared ? 0 : update.scale_weight;
  const float opacity = exp(LogSigmoid(to.value.opacity_logit[i]));
  step(d.opacity_logit + opacity_weight * opacity * (1 - opacity), rates.opacity_logit, i,
       &SplatPointers::opacity_logit);
  const float rate_mean = rates.MeanAt(to.value.mean + 3 * i);
  for (int a = 0; a < 3; ++a) {
    const int64_t k = 3 * i + a;
    const float log_scale = to.value.log_scale[k];
    const float scale = exp(log_scale < 20.0f ? log_scale : 20.0f) * LogScaleCounts(log_scale);
    step(d.mean[a], rate_mean, k, &SplatPointers::mean);
    step(d.log_scale[a] + scale_weight * scale, rates.log_scale, k, &SplatPointers::log_scale);
  }
  for (int a = 0; a < 4; ++a)
    step(d.quaternion[a], rates.quaternion, 4 * i + a, &SplatPointers::quaternion);
  const float *mean = to.value.mean + 3 * i, *log_scale = to.value.log_scale + 3 * i,
              *q = to.value.quaternion + 4 * i;
  const Splat<float> splat = {{mean[0], mean[1], mean[2]},
                              {log_scale[0], log_scale[1], log_scale[2]},
                              {q[0], q[1], q[2], q[3]},
                              to.value.opacity_logit[i]};
  AddSplatNoise(update, i, splat, to.value.mean + 3 * i);
  if (!update.hold.Contains(mean))
    for (int a = 0; a < 3; ++a) to.value.mean[3 * i + a] = before[a];
  return true;
}

// The same of one coefficient sh[k], which is of degree 0 (`of_mean`) or of another.
HD inline bool UpdateColor(const SplatUpdate& update, bool of_mean, float d, int64_t k,
                           const SplatMoments& to) {
  using std::abs;
  if (!(abs(d) < kLargestGradient)) return false;
  update.Step(d, of_mean ? update.rates.sh_mean : update.rates.sh_rest, to.value.sh + k,
              to.first.sh + k, to.second.sh + k);
  SplatUpdate::Bound(of_mean ? update.mean_bound : update.view_bound, to.value.sh + k);
  return true;
}

// The same of all coefficients of splat i, by vectors.
inline bool UpdateColors(const SplatUpdate& update, int64_t i, int basis, const float* d_sh,
                         const SplatMoments& to) {
  float sum = 0;
  for (int k = 0; k < 3 * basis; ++k) sum += std::abs(d_sh[k]);
  if (!(sum < kLargestGradient)) return false;
  for (int c = 0; c < 3; ++c) {
    const int64_t row = (3 * i + c) * basis;
    UpdateColor(update, true, d_sh[c * basis], row, to);
    float *value = to.value.sh + row, *first = to.first.sh + row, *second = to.second.sh + row;
#pragma omp simd
    for (int b = 1; b < basis; ++b) {
      update.Step(d_sh[c * basis + b], update.rates.sh_rest, value + b, first + b, second + b);
      SplatUpdate::Bound(update.view_bound, value + b);
    }
  }
  return true;
}

inline SplatPointers PointersOf(SplatArrays<float>* splats) {
  return {splats->mean.data(), splats->log_scale.data(), splats->quaternion.data(),
          splats->opacity_logit.data(), splats->sh.data()};
}

}  // namespace regrade
