// Options of the style's network and its training, and the recipes that set them.
#pragma once

#include <cstdint>
#include <string>

#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/weight_update.h"

namespace regrade {

struct TrainNetworkOptions : WeightUpdateOptions {
  std::string recipe = "standard";
  AggregationOptions loss{
      .min_weight = 1e-3f, .max_transmittance = 0.5f, .one_sided = true, .view_weight = 1};
  std::string loss_scale = "mean";
  int rays_per_step = 4096;
  int patch = 8;
  bool map_background = true;
  std::string base = "best";
  std::string start = "pytorch";
  std::string view_order = "random";
  double bound_factor = 4;
  float sh_scale = 2;
  float position_scale = 8;
  std::string activation = "sine";
  float omega = 1.5f;
  bool no_k_est = false;
  uint64_t seed = 0;  // of the run; not an option of this stage

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("recipe", recipe,
         {.help = "standard: a colour map and a bounded residual; paper: LipRF as published",
          .choices = "standard|paper"});
    WeightUpdateOptions::Describe(bind);
    loss.Describe(bind);
    bind(
        "style-loss", loss_scale,
        {.help =
             "mean over rays and channels, or the paper's sum divided by what the network maps",
         .choices = "mean|sum-over-voxels",
         .constant = true});
    bind("style-rays", rays_per_step,
         {.unit = "rays",
          .help = "rays of a training step, in square patches; 0 takes a whole view",
          .min = 0,
          .max = 1e8,
          .constant = true});
    bind("style-patch", patch,
         {.unit = "pixels",
          .help = "side of a patch; rays of larger patches share more voxels, which is faster "
                  "and gives noisier gradients",
          .min = 1,
          .max = 1024,
          .constant = true});
    bind("style-map-background", map_background,
         {.help = "maps the background colour by the scene-wide colour map; off keeps it",
          .constant = true});
    bind("style-base", base,
         {.help = "colour map that the network starts from; best is least squares where it is "
                  "closer to the 2D method and no steeper than mkl, else mkl",
          .choices = "best|mkl|least-squares|none",
          .constant = true});
    bind("style-start", start,
         {.help = "ablation, with style-base none: initial weights; pytorch maps all voxels "
                  "to almost one colour, orthogonal keeps their distances, identity starts "
                  "near the field's colours, siren is that of sine networks, siren-wide-end "
                  "the same with a last layer as wide as the others, siren-even with a first "
                  "one as narrow",
          .choices = "pytorch|orthogonal|identity|siren|siren-wide-end|siren-even",
          .constant = true});
    bind("style-view-order", view_order,
         {.help = "of whole views (style-rays 0): random draws each anew, passes takes all in "
                  "random order before any comes again",
          .choices = "random|passes",
          .constant = true});
    bind("style-bound", bound_factor,
         {.help = "largest certified Lipschitz bound, in units of K_est; 0 sets no limit",
          .min = 0,
          .max = 1e6,
          .constant = true});
    bind("style-position-scale", position_scale,
         {.help = "how strongly the style may vary with position",
          .min = 0,
          .max = 100,
          .constant = true});
    bind("style-sh-scale", sh_scale,
         {.help = "how strongly the style may vary with colour; a factor of the bound",
          .min = 0.01,
          .max = 100,
          .constant = true});
    bind("style-activation", activation,
         {.help = "of the hidden layers: sine follows strong styles best; relu and leaky-relu "
                  "are piecewise linear and slightly less faithful; sigmoid and tanh saturate "
                  "far from 0 and may stop training",
          .choices = "sine|relu|leaky-relu|sigmoid|tanh",
          .constant = true});
    bind("style-omega", omega,
         {.help = "frequency of the sine; five layers multiply the bound by its fifth power",
          .min = 0.01,
          .max = 100,
          .constant = true});
    bind("style-no-k-est", no_k_est,
         {.help = "ablation: regularises towards 0 instead of K_est: a smaller bound, paler "
                  "colours",
          .constant = true});
  }
};

// Sets every option that the recipe decides: "standard", or "paper" (LipRF Sec. 6: no colour
// map, PyTorch's default initialisation, a whole view a step, 300 steps, 1e-2 to 1e-4, one
// step of the power iteration; stylize/README.md lists the readings that were chosen). Call it
// before options are read. Throws Error(kUsage) for another name.
void ApplyStyleRecipe(const std::string& recipe, TrainNetworkOptions* options);

// The loss that `options` ask for, along rays marched as `march` says.
AggregationOptions LossOptions(const TrainNetworkOptions& options, const MarchOptions& march);

}  // namespace regrade
