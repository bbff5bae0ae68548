#include "reconstruct/fit/adapt_options.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int64_t kLeastRays = 4096, kMostRays = 16384;

// Chosen on a forward-facing capture at two sizes; see COSTS.md.
void UseRatesOfDeviceCoordinates(FitOptions* options) {
  const FitOptions plain;
  FitOptions other;
  other.rate_density = 12;
  other.rate_density_end = 2;
  other.tv_density = 0.1f;
  other.tv_sh = 8e-3f;
  other.free_space = 0;
  for (float FitOptions::*value :
       {&FitOptions::rate_density, &FitOptions::rate_density_end, &FitOptions::tv_density,
        &FitOptions::tv_sh, &FitOptions::free_space})
    if (options->*value == plain.*value) options->*value = other.*value;
}

void DropStages(int64_t pixels, FitOptions* options) {
  REGRADE_CHECK_EQ(options->resolutions.size(), options->steps.size());
  const double finest = std::sqrt(static_cast<double>(pixels)) / 2;
  while (options->resolutions.size() > 1 && options->resolutions.back() > finest) {
    options->resolutions.pop_back();
    options->steps.pop_back();
  }
}

}  // namespace

FitOptions AdaptOptions(FitOptions options, const FitConditions& conditions) {
  if (options.adaptive() && options.fewer_stages && conditions.pixels > 0)
    DropStages(conditions.pixels, &options);
  if (options.rays_per_step == 0) {
    const int64_t steps =
        std::accumulate(options.steps.begin(), options.steps.end(), int64_t{0});
    const int64_t rays = kPasses * conditions.pixels / std::max<int64_t>(steps, 1);
    options.rays_per_step = static_cast<int>(
        std::clamp(rays, kLeastRays, conditions.on_card ? kMostRays : kLeastRays));
  }
  if (conditions.device_coordinates && options.adaptive())
    UseRatesOfDeviceCoordinates(&options);
  return options;
}

}  // namespace regrade
