#include "pipeline/run/run_settings.h"

#include <algorithm>
#include <iterator>

#include "kernels/base/error.h"

namespace regrade {

void RunSettings::Bind(OptionSet* options) {
  options->Add("Run", &run);
  options->Add("Start", &start);
  options->Add("Photos", &ingest);
  options->Add("Poses", &pose);
  options->Add("Scene", &scene);
  options->Add("Fit", &fit);
  options->Add("Style", &style);
  options->Add("2D method", &style_2d);
  options->Add("Object", &object);
  options->Add("Network", &network);
  options->Add("Render", &render);
  options->Add("Evaluation", &consistency);
  options->Add("Program", &program);
}

bool IsPreset(const std::string& name) {
  return std::find(std::begin(kPresets), std::end(kPresets), name) != std::end(kPresets);
}

void ApplyPreset(const std::string& preset, RunSettings* settings) {
  settings->run.preset = preset;
  ApplyStyleRecipe(preset == "paper" ? "paper" : "standard", &settings->network);
  if (preset == "standard") return;  // the defaults of the structs
  if (preset == "draft") {
    settings->scene.photo_size = 480;
    settings->fit.resolutions = {64, 128, 256};
    settings->fit.steps = {400, 700, 800};
    settings->render.film_seconds = 6;
    settings->render.film_size = 480;
  } else if (preset == "best") {
    settings->scene.photo_size = 1280;
    settings->fit.resolutions = {96, 192, 384, 768};
    settings->fit.steps = {1500, 2000, 3000, 5500};
    settings->network.steps = 600;
    settings->render.film_seconds = 12;
    settings->render.film_size = 1920;
  } else if (preset == "paper") {
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
  } else {
    throw UsageError("'" + preset + "' is not allowed", "--preset",
                     "allowed: draft, standard, paper, best");
  }
}

void CheckTogether(const RunSettings& settings) {
  const size_t grids = settings.fit.resolutions.size(), steps = settings.fit.steps.size();
  if (grids != steps)
    throw UsageError(Concat(grids, " and ", steps, " stages"),
                     "--fit-resolutions and --fit-steps",
                     "give both the same number of stages");
  ParseStyleMethod(settings.style_2d);
  if (!settings.object.style_mask.empty() && !settings.object.On())
    throw UsageError("labels of the style picture need labels of the photos",
                     "--style-mask and --masks",
                     "give --masks, a folder of labels for the photos");
}

}  // namespace regrade
