// Adam on a flat vector of parameters.
//
// EQ(adam), Kingma and Ba 2015:  m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,
//   x -= rate (m / (1 - b1^t)) / (sqrt(v / (1 - b2^t)) + epsilon),   t = 1, 2, ...
// epsilon is outside the root: a gradient that has always been 0 moves nothing, and one whose
// square underflows takes a tiny step, not an infinite one.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "kernels/base/host_device.h"
#include "kernels/base/view.h"

namespace regrade {

struct AdamOptions {
  float beta1 = 0.9f;
  float beta2 = 0.999f;
  float epsilon = 1e-8f;
};

// 1 - beta^t without cancellation, for any t >= 1.
HD inline double AdamBiasCorrection(double beta, int64_t t) {
  using std::expm1, std::log;
  return -expm1(static_cast<double>(t) * log(beta));
}

// Gradients of this magnitude or more, whose square is not finite, are rejected.
inline constexpr float kLargestGradient = 1e19f;

template <typename T>
HD void AdamUpdate(T gradient, T beta1, T beta2, T epsilon, T rate_over_correction1,
                   T inverse_correction2, T* value, T* first_moment, T* second_moment) {
  using std::sqrt;
  *first_moment = beta1 * *first_moment + (1 - beta1) * gradient;
  *second_moment = beta2 * *second_moment + (1 - beta2) * gradient * gradient;
  *value -= rate_over_correction1 * *first_moment /
            (sqrt(*second_moment * inverse_correction2) + epsilon);
}

// The state a resumed run needs.
struct AdamState {
  std::vector<float> first_moment, second_moment;
  int64_t steps = 0;     // taken
  int64_t rejected = 0;  // steps
};

// One step. A gradient that is not finite, or whose square is not (|g| >= 1e19 would freeze its
// weight permanently), changes no value and no moment: the step is counted as rejected and the
// function returns false.
bool AdamStep(const AdamOptions& options, double rate, View<const float> gradient,
              View<float> values, AdamState* state);

}  // namespace regrade
