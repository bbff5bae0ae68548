#include "kernels/optimize/adam.h"

#include <cmath>

#include "kernels/base/error.h"

namespace regrade {

bool AdamStep(const AdamOptions& options, double rate, View<const float> gradient,
              View<float> values, AdamState* state) {
  REGRADE_CHECK_EQ(gradient.size, values.size);
  const size_t size = static_cast<size_t>(values.size);
  if (state->steps == 0) {
    state->first_moment.assign(size, 0.0f);
    state->second_moment.assign(size, 0.0f);
  }
  REGRADE_CHECK_EQ(state->first_moment.size(), size);
  REGRADE_CHECK_EQ(state->second_moment.size(), size);
  for (const float g : gradient)
    if (!(std::abs(g) < kLargestGradient)) {
      ++state->rejected;
      return false;
    }
  const int64_t t = ++state->steps;
  const float step = static_cast<float>(rate / AdamBiasCorrection(options.beta1, t));
  const float inverse = static_cast<float>(1 / AdamBiasCorrection(options.beta2, t));
  for (size_t i = 0; i < size; ++i)
    AdamUpdate(gradient[static_cast<int64_t>(i)], options.beta1, options.beta2, options.epsilon,
               step, inverse, &values[static_cast<int64_t>(i)], &state->first_moment[i],
               &state->second_moment[i]);
  return true;
}

}  // namespace regrade
