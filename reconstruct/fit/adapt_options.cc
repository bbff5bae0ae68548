#include "reconstruct/fit/adapt_options.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr int64_t kLeastRays = 4096, kMostRays = 14336;

// What suits a capture, where nothing was asked for.
struct SuitableRates {
  float rate_density = 58, rate_density_end = 24;
  float tv_density = 5e-2f, tv_sh = 4e-3f;
  float free_space = 0.02f;
};

// Cells a side, from which on the weight of total variation grows with them.
constexpr float kVariationSide = 768;

// Chosen on a forward-facing capture at two sizes and on a synthetic one; see COSTS.md. Across
// a cell half as wide values differ half as much, so the weight of total variation is doubled.
SuitableRates RatesInDeviceCoordinates(int finest) {
  SuitableRates rates{.rate_density = 12, .rate_density_end = 2, .free_space = 0};
  const float finer = std::max(1.0f, static_cast<float>(finest) / kVariationSide);
  rates.tv_density *= finer;
  rates.tv_sh *= finer;
  return rates;
}

// Chosen on a synthetic capture with transparent photos; see COSTS.md.
SuitableRates RatesBeforeKnownBackground() { return {.tv_density = 2e-3f, .tv_sh = 1.6e-4f}; }

void FillIn(const SuitableRates& rates, FitOptions* options) {
  const auto fill = [](float suitable, std::optional<float>* asked) {
    if (!asked->has_value()) *asked = suitable;
  };
  fill(rates.rate_density, &options->rate_density);
  fill(rates.rate_density_end, &options->rate_density_end);
  fill(rates.tv_density, &options->tv_density);
  fill(rates.tv_sh, &options->tv_sh);
  if (options->adaptive()) fill(rates.free_space, &options->free_space);
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
  const bool forward = options.adaptive() && conditions.device_coordinates;
  if (forward) options.max_cells = std::min(options.max_cells, options.max_forward_cells);
  FillIn(forward ? RatesInDeviceCoordinates(options.resolutions.back())
         : options.adaptive() && conditions.known_background ? RatesBeforeKnownBackground()
                                                             : SuitableRates(),
         &options);
  return options;
}

std::string NoteOfAdapting(const FitOptions& asked, const FitOptions& adapted) {
  if (!asked.adaptive() || asked.max_cells <= adapted.max_cells) return "";
  return Format("the photos face one way, so the field has at most %g million cells",
                double{adapted.max_cells}) +
         " (fit-max-forward-cells)";
}

}  // namespace regrade
