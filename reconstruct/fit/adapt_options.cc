#include "reconstruct/fit/adapt_options.h"

#include <algorithm>
#include <numeric>

namespace regrade {
namespace {

constexpr int64_t kLeastRays = 4096, kMostRays = 14336;

}  // namespace

FitOptions AdaptOptions(FitOptions options, const FitConditions& conditions) {
  if (options.rays_per_step != 0) return options;
  const int64_t steps = std::accumulate(options.steps.begin(), options.steps.end(), int64_t{0});
  const int64_t rays = kPasses * conditions.pixels / std::max<int64_t>(steps, 1);
  options.rays_per_step = static_cast<int>(
      std::clamp(rays, kLeastRays, conditions.on_card ? kMostRays : kLeastRays));
  return options;
}

}  // namespace regrade
