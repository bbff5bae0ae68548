// Options of fitting splats.
#pragma once

#include <cstdint>

#include "kernels/base/options.h"

namespace regrade {

// Constants are those of Kheradmand et al. 2024, whose schedule has 30000 steps and scales with
// them, but for: initial_scale (0.1 there) and both weights (0.01), which leave fewer holes and
// needles between few photos, and the steps at half size. Fits of few steps raise their rates,
// see FitSplats.
struct SplatFitOptions {
  int steps = 15000;
  float thousands = 1000;  // of splats, at most
  int sh_degree = 2;
  float ssim_weight = 0.2f;
  float opacity_weight = 0.03f, scale_weight = 0.03f;
  // See EQ(splat-depth): at the points that COLMAP found. It falls to a hundredth, in long
  // fits to a millionth: depths say early which surfaces there are, and photos late where
  // exactly they lie.
  float depth_weight = 0.1f;
  // Of Adam. That of means is over the cameras' extent, and falls exponentially.
  float rate_mean = 1.6e-4f, rate_mean_end = 1.6e-6f;
  float rate_scale = 5e-3f, rate_quaternion = 1e-3f, rate_opacity = 5e-2f;
  float rate_color = 2.5e-3f, rate_view = 1.25e-4f;
  float noise = 5e5f;                                   // over the rate of means
  float initial_opacity = 0.5f, initial_scale = 0.25f;  // over the distance of neighbours
  // Parts of all steps.
  float grow_from = 1.0f / 60, grow_until = 5.0f / 6, grow_each = 1.0f / 300;
  float growth = 0.05f;  // of the splats, each time
  // In long fits each photo is seen so often between two changes, if that is not longer than
  // the second: copies begin with moments of 0, and need to be seen before they are moved again
  // (room of 55 photos: 2.6 dB).
  float grow_rounds = 3, grow_each_most = 1.0f / 60;
  float degree_each = 1.0f / 30;
  float small_until = 0.3f;  // at half the photos' size
  // Long fits have so many steps or more. They would learn their photos by heart: in them the
  // share of EQ(splat-dropout) rises to `dropout`, and in their second half all other rates
  // than that of means fall to `fall` of what they were, so that what this stirs settles.
  int long_from = 4000;
  float dropout = 0.1f, fall = 0.1f;
  // Long fits of fewer photos multiply both weights by this.
  int few_photos = 16;
  float few_photos_weights = 2;
  float begin = 0;  // part of all steps that a refinement leaves out
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("splat-steps", steps,
         {.unit = "steps",
          .help = "optimizer steps of a fit of splats, each on one photo",
          .min = 1,
          .max = 1000000});
    bind("splats", thousands,
         {.unit = "thousands", .help = "most splats of a field", .min = 1, .max = 1000000});
    bind("splat-degree", sh_degree,
         {.help = "view dependence: degree of the splats' spherical harmonics",
          .min = 0,
          .max = 3,
          .constant = true});
    bind("splat-opacity-weight", opacity_weight,
         {.help = "weight of the mean opacity in the loss: larger values leave fewer "
                  "half-transparent splats; it counts twice in fits of 4000 steps and more of "
                  "fewer than 16 photos",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("splat-scale-weight", scale_weight,
         {.help = "weight of the mean scale in the loss, as that of the opacity: larger values "
                  "leave smaller splats",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("splat-depth-weight", depth_weight,
         {.help = "weight in the loss of how far expected depths are from those of COLMAP's "
                  "points: without it walls may be thin, with what shows behind them",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("splat-small-until", small_until,
         {.unit = "fraction of all steps",
          .help = "photos have half their size until then",
          .min = 0,
          .max = 1,
          .constant = true});
  }
};

}  // namespace regrade
