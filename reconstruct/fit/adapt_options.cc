#include "reconstruct/fit/adapt_options.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numeric>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int64_t kLeastRays = 4096, kMostRays = 14336;

using Rate = float FitOptions::*;

// Takes the values of `other`, except those that were asked for.
void TakeDefaults(const FitOptions& other, std::initializer_list<Rate> rates,
                  FitOptions* options) {
  const FitOptions plain;
  for (const Rate rate : rates)
    if (options->*rate == plain.*rate) options->*rate = other.*rate;
}

// Cells a side, from which on the weight of total variation grows with them.
constexpr float kVariationSide = 768;

// Chosen on a forward-facing capture at two sizes and on a synthetic one; see COSTS.md. Across
// a cell half as wide values differ half as much, so the weight of total variation is doubled.
void AdaptToDeviceCoordinates(FitOptions* options) {
  FitOptions other;
  other.rate_density = 12;
  other.rate_density_end = 2;
  other.free_space = 0;
  const float finer =
      std::max(1.0f, static_cast<float>(options->resolutions.back()) / kVariationSide);
  other.tv_density *= finer;
  other.tv_sh *= finer;
  TakeDefaults(other,
               {&FitOptions::rate_density, &FitOptions::rate_density_end,
                &FitOptions::free_space, &FitOptions::tv_density, &FitOptions::tv_sh},
               options);
  options->max_cells = std::min(options->max_cells, options->max_forward_cells);
}

// Chosen on a synthetic capture with transparent photos; see COSTS.md.
void AdaptToKnownBackground(FitOptions* options) {
  FitOptions other;
  other.tv_density = 2e-3f;
  other.tv_sh = 1.6e-4f;
  TakeDefaults(other, {&FitOptions::tv_density, &FitOptions::tv_sh}, options);
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
  if (options.adaptive()) {
    if (conditions.device_coordinates)
      AdaptToDeviceCoordinates(&options);
    else if (conditions.known_background)
      AdaptToKnownBackground(&options);
  }
  return options;
}

std::string NoteOfAdapting(const FitOptions& asked, const FitOptions& adapted) {
  if (!asked.adaptive() || asked.max_cells <= adapted.max_cells) return "";
  return Format("the photos face one way, so the field has at most %g million cells",
                double{adapted.max_cells}) +
         " (--fit-max-forward-cells)";
}

}  // namespace regrade
