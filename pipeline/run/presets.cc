#include "pipeline/run/presets.h"

#include <algorithm>
#include <iterator>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// The fit takes about 1, 5 and 20 minutes on two cores, at most 10, 40 and 120 s on a card of
// the class of an H200.
struct FitEffort {
  const char* preset;
  bool on_card;
  std::vector<int> resolutions, steps;
  float max_cells;  // millions
};

const FitEffort kFitEfforts[] = {
    {"draft", false, {48, 96, 192, 384}, {350, 350, 400, 450}, 3},
    {"standard", false, {48, 96, 192, 384, 768}, {600, 700, 900, 1200, 1400}, 8},
    {"best", false, {48, 96, 192, 384, 768}, {1500, 1500, 2000, 3000, 4500}, 16},
    {"draft", true, {48, 96, 192, 384}, {600, 600, 700, 1100}, 6},
    {"standard", true, {48, 96, 192, 384, 768}, {800, 800, 1000, 1200, 2400}, 12},
    {"best", true, {48, 96, 192, 384, 768, 1536}, {2000, 2000, 2400, 2400, 3600, 6000}, 20},
};

void UseFitEffort(const std::string& preset, bool on_card, FitOptions* fit) {
  const auto found = std::ranges::find_if(kFitEfforts, [&](const FitEffort& effort) {
    return effort.preset == preset && effort.on_card == on_card;
  });
  if (found == std::end(kFitEfforts)) return;
  fit->resolutions = found->resolutions;
  fit->steps = found->steps;
  fit->max_cells = found->max_cells;
}

void UsePaper(RunSettings* settings) {
  // svox2's configuration for custom captures; LipRF's recipe for the style.
  settings->scene.photo_size = 1280;
  settings->fit.MakeUniform();
  settings->fit.resolutions = {128, 256, 512};
  settings->fit.steps = {25600, 25600, 51200};
  settings->fit.rays_per_step = 5000;
  settings->fit.patch = 1;
  settings->fit.step = 0.5f;
  settings->fit.view_bound = 1e6f;
  settings->fit.stop_transmittance = 1e-7f;
  settings->fit.rate_density = 30;
  settings->fit.rate_density_end = 1.5f;
  settings->fit.rate_sh = 1e-2f;
  settings->fit.rate_sh_end = 4e-4f;
  settings->fit.tv_density = settings->fit.tv_sh = 5e-3f;
  settings->fit.tv_fraction = 0.01f;
  settings->fit.prune_weight = 1.28f;
  settings->fit.initial_density = 0.1f;
  // Final rates are those of svox2's schedule of 250000 steps after 102400.
  settings->fit.background_resolution = 1024;
  settings->fit.background_lead = 0.04f;
  settings->fit.rate_background_density = 3;
  settings->fit.rate_background_density_end = 0.18f;
  settings->fit.rate_background_color = 0.1f;
  settings->fit.rate_background_color_end = 1.7e-3f;
}

}  // namespace

bool IsPreset(const std::string& name) {
  return std::find(std::begin(kPresets), std::end(kPresets), name) != std::end(kPresets);
}

void ApplyPreset(const std::string& preset, bool on_card, RunSettings* settings) {
  if (!IsPreset(preset))
    throw UsageError("'" + preset + "' is not allowed", "--preset",
                     "allowed: draft, standard, paper, best");
  settings->run.preset = preset;
  ApplyStyleRecipe(preset == "paper" ? "paper" : "standard", &settings->network);
  UseFitEffort(preset, on_card, &settings->fit);
  if (preset == "draft") {
    settings->scene.photo_size = 480;
    settings->render.film_seconds = 6;
    settings->render.film_size = 480;
  } else if (preset == "best") {
    settings->scene.photo_size = 1280;
    settings->network.steps = 600;
    settings->render.film_seconds = 12;
    settings->render.film_size = 1920;
  } else if (preset == "paper") {
    UsePaper(settings);
  }
}

}  // namespace regrade
