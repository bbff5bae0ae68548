// What the recipes of the style's network decide.
#include "kernels/base/error.h"
#include "stylize/training/train_network_options.h"

namespace regrade {

void ApplyStyleRecipe(const std::string& recipe, TrainNetworkOptions* options) {
  if (recipe != "standard" && recipe != "paper")
    throw UsageError("unknown recipe '" + recipe + "'", "--recipe", "use standard or paper");
  const uint64_t seed = options->seed;
  *options = TrainNetworkOptions{};
  options->seed = seed;
  options->recipe = recipe;
  if (recipe == "standard") return;
  options->steps = 300;
  options->rate_first = 1e-2;
  options->rate_last = 1e-4;
  options->norm_steps = 1;
  options->settle_norms = false;
  options->loss = AggregationOptions{};  // two-sided, of all rays and samples, no view penalty
  options->loss_scale = "sum-over-voxels";
  options->rays_per_step = 0;
  options->map_background = false;
  options->base = "none";
  options->sh_scale = 1;
  options->position_scale = 1;
  options->omega = 1;
  options->bound_factor = 0;
}

AggregationOptions LossOptions(const TrainNetworkOptions& options, const MarchOptions& march) {
  AggregationOptions loss = options.loss;
  loss.march = march;
  loss.divide_by_voxels = options.loss_scale == "sum-over-voxels";
  return loss;
}

}  // namespace regrade
