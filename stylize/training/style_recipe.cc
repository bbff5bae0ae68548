// What the recipes of the style's network decide.
#include "kernels/base/error.h"
#include "stylize/training/train_network.h"

namespace regrade {

void ApplyStyleRecipe(const std::string& recipe, TrainNetworkOptions* options) {
  if (recipe != "standard" && recipe != "paper")
    throw Error(ExitCode::kUsage, "unknown recipe '" + recipe + "'", "--recipe",
                "use standard or paper");
  const uint64_t seed = options->seed;
  *options = TrainNetworkOptions{};
  options->seed = seed;
  options->recipe = recipe;
  if (recipe == "standard") return;
  options->base = "none";
  options->steps = 300;
  options->rate_first = 1e-2;
  options->rate_last = 1e-4;
  options->view_weight = 0;
  options->rays_per_step = 0;
  options->min_weight = 0;
  options->sh_scale = 1;
  options->position_scale = 1;
  options->omega = 1;
  options->norm_steps = 1;
  options->bound_factor = 0;
}

}  // namespace regrade
