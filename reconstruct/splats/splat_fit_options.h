// Options of fitting splats.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/options.h"

namespace regrade {

// The constants are those of Kheradmand et al. 2024 for 30000 steps; schedules scale with the
// steps.
struct SplatFitOptions {
  int steps = 15000;
  float thousands = 1000;  // of splats, at most
  int sh_degree = 3;
  float ssim_weight = 0.2f;
  float opacity_weight = 0.01f, scale_weight = 0.01f;
  // Of Adam. That of means is over the scene's extent, and falls exponentially.
  float rate_mean = 1.6e-4f, rate_mean_end = 1.6e-6f;
  float rate_scale = 5e-3f, rate_quaternion = 1e-3f, rate_opacity = 5e-2f;
  float rate_color = 2.5e-3f, rate_view = 1.25e-4f;
  float noise = 5e5f;  // over the rate of means
  float initial_opacity = 0.5f, initial_scale = 0.1f;  // over the distance of neighbours
  // Parts of all steps.
  float grow_from = 1.0f / 60, grow_until = 5.0f / 6, grow_each = 1.0f / 300;
  float growth = 0.05f;        // of the splats, each time
  float degree_each = 1.0f / 30;
  float small_until = 0;  // steps at half the photos' size
  bool antialiased = false;
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("splat-steps", steps,
         {.unit = "steps",
          .help = "optimizer steps of a fit of splats, each on one photo",
          .min = 1,
          .max = 1000000});
    bind("splats", thousands,
         {.unit = "thousands", .help = "most splats of a field", .min = 1, .max = 20000});
    bind("splat-degree", sh_degree,
         {.help = "degree of the splats' spherical harmonics", .min = 0, .max = 3});
    bind("splat-ssim-weight", ssim_weight, {.help = "weight of SSIM in the loss", .min = 0, .max = 1});
    bind("splat-opacity-weight", opacity_weight, {.help = "regulariser", .min = 0, .max = 10});
    bind("splat-scale-weight", scale_weight, {.help = "regulariser", .min = 0, .max = 10});
    bind("splat-rate-mean", rate_mean, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-mean-end", rate_mean_end, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-scale", rate_scale, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-quaternion", rate_quaternion, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-opacity", rate_opacity, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-color", rate_color, {.help = "rate", .min = 0, .max = 1});
    bind("splat-rate-view", rate_view, {.help = "rate", .min = 0, .max = 1});
    bind("splat-noise", noise, {.help = "noise", .min = 0, .max = 1e9});
    bind("splat-initial-opacity", initial_opacity, {.help = "o", .min = 0.01, .max = 0.99});
    bind("splat-initial-scale", initial_scale, {.help = "s", .min = 0.001, .max = 10});
    bind("splat-grow-from", grow_from, {.help = "part", .min = 0, .max = 1});
    bind("splat-grow-until", grow_until, {.help = "part", .min = 0, .max = 1});
    bind("splat-grow-each", grow_each, {.help = "part", .min = 0, .max = 1});
    bind("splat-growth", growth, {.help = "part", .min = 0, .max = 1});
    bind("splat-degree-each", degree_each, {.help = "part", .min = 0, .max = 1});
    bind("splat-small-until", small_until, {.help = "part", .min = 0, .max = 1});
    bind("splat-antialiased", antialiased, {.help = "filter"});
  }
};

}  // namespace regrade
