#include "pipeline/run_settings.h"

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
  options->Add("Program", &program);
}

void ApplyPreset(const std::string& preset, RunSettings* settings) {
  settings->run.preset = preset;
  if (preset == "standard") return;  // what the structs say themselves
  if (preset == "draft") {
    settings->scene.photo_size = 400;
    settings->fit.resolutions = {48, 96};
    settings->fit.steps = {400, 600};
    settings->fit.rays_per_step = 4096;
    settings->fit.sh_degree = 1;
  } else if (preset == "best") {
    settings->scene.photo_size = 1280;
    settings->fit.resolutions = {96, 192, 320};
    settings->fit.steps = {2000, 3000, 4000};
  } else if (preset == "paper") {
    // svox2's configuration for captures of one's own; LipRF's recipe for the style.
    settings->scene.photo_size = 1280;
    settings->fit.resolutions = {128, 256, 512};
    settings->fit.steps = {25600, 25600, 51200};
    settings->fit.rays_per_step = 5000;
    settings->fit.patch = 1;
    settings->fit.stop_transmittance = 1e-7f;
  } else {
    throw Error(ExitCode::kUsage, "'" + preset + "' is not allowed", "--preset",
                "allowed: draft, standard, paper, best");
  }
}

}  // namespace regrade
