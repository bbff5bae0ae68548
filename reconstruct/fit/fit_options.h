// Options of fitting a radiance field.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/field/march_options.h"

namespace regrade {

struct FitOptions {
  std::vector<int> resolutions = {64, 128, 256};
  std::vector<int> resolutions_y, resolutions_z;
  std::vector<int> steps = {800, 2000, 3000};
  int rays_per_step = 0;  // 0: see AdaptOptions
  int patch = 1;
  int sh_degree = 2;
  float view_bound = 0.2f;
  float step = 1.0f;
  bool ball = false;
  float stop_transmittance = 1e-3f;
  float rate_density = 8.0f;
  float rate_density_end = 1.0f;
  int rate_steps = 0;
  float density_delay = 0;
  float rate_sh = 6e-2f;
  float rate_sh_end = 5e-3f;
  float tv_density = 1e-2f;
  float tv_sh = 1e-2f;
  float tv_decay = 0.5f;
  float tv_fraction = 0.03f;
  float beta_loss = 0;
  float sparsity_loss = 0;
  bool bound_mean = true;
  std::string prune_by = "weight";
  float prune_weight = 0.5f;
  bool prune_last = true;
  float max_voxels = 0;
  int initial_views = 2;
  float initial_density = 0.5f;
  int background_layers = 64;
  int background_resolution = 512;
  bool background_grows = true;
  float rate_background_density = 10.0f;
  float rate_background_density_end = 1.0f;
  float rate_background_color = 0.1f;
  float rate_background_color_end = 5e-3f;
  float tv_background_density = 5e-3f;
  float tv_background_color = 5e-3f;
  float tv_background_fraction = 0.01f;
  bool tv_background_decays = true;
  float initial_background_density = 0.1f;
  float background_lead = 0.9f;
  int shards = 0;
  bool exact_sums = false;
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("fit-resolutions", resolutions,
         {.unit = "voxels",
          .help = "longest side of the grid in each stage, coarse to fine; memory grows with "
                  "its cube",
          .min = 8,
          .max = 2048,
          .constant = true});
    bind("fit-resolutions-y", resolutions_y,
         {.unit = "voxels",
          .help = "fit-resolutions are of the box's x axis, and these of its y axis; none: as "
                  "the box's sides",
          .min = 2,
          .max = 2048,
          .may_be_empty = true,
          .constant = true});
    bind("fit-resolutions-z", resolutions_z,
         {.unit = "voxels",
          .help = "the same of the z axis",
          .min = 2,
          .max = 2048,
          .may_be_empty = true,
          .constant = true});
    bind("fit-steps", steps,
         {.unit = "steps",
          .help = "optimizer steps in each stage; time grows with their sum",
          .min = 1,
          .max = 1000000,
          .constant = true});
    bind("fit-rays", rays_per_step,
         {.unit = "rays",
          .help = "rays per step; 0: 4096, on a card more for captures of many pixels",
          .min = 0,
          .max = 1 << 22,
          .constant = true});
    bind("fit-patch", patch,
         {.unit = "pixels",
          .help = "side of the pixel squares that rays are drawn in: larger is faster (rays "
                  "share cached voxels) but less accurate; a GPU draws single pixels",
          .min = 1,
          .max = 32,
          .constant = true});
    bind("sh-degree", sh_degree,
         {.help = "view dependence: spherical harmonics degree 0, 1 or 2 (1, 4, 9 values per "
                  "channel); a small trial falls back to 0 where that loses nothing",
          .min = 0,
          .max = 2,
          .constant = true});
    bind("fit-mean-bound", bound_mean,
         {.help = "keeps the mean colour of a voxel within [0, 1], and that of background "
                  "layers",
          .constant = true});
    bind("fit-view-bound", view_bound,
         {.help = "largest view-dependent coefficient; limits coefficients that are hidden by "
                  "clamping and would appear after restyling",
          .min = 0,
          .max = 1e6,
          .constant = true});
    bind("fit-step-size", step,
         {.unit = "voxels",
          .help = "distance of samples along a ray; 0.5 takes twice as long as 1 and gained "
                  "nothing on real photos",
          .min = 0.1,
          .max = 4,
          .constant = true});
    bind("fit-ball", ball,
         {.help = "the first grid has the voxels within the box's ball alone",
          .constant = true});
    bind("fit-stop", stop_transmittance,
         {.help = "transmittance at which a ray ends; the error per channel is at most this",
          .min = 0,
          .max = 0.1,
          .constant = true});
    bind("fit-rate-density", rate_density,
         {.help = "RMSProp learning rate of densities at the start",
          .min = 0,
          .max = 1e4,
          .constant = true});
    bind("fit-rate-density-end", rate_density_end,
         {.help = "learning rate of densities at the end (exponential in between)",
          .min = 0,
          .max = 1e4,
          .constant = true});
    bind("fit-rate-steps", rate_steps,
         {.unit = "steps",
          .help = "learning rates reach their ends after so many steps, even if the fit ends "
                  "before; 0: at its end",
          .min = 0,
          .max = 10000000,
          .constant = true});
    bind("fit-density-delay", density_delay,
         {.unit = "fraction of all steps",
          .help = "raises the learning rate of densities along a sine, from a hundredth to its "
                  "full value: colours settle before surfaces, and less fog remains",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("fit-rate-sh", rate_sh,
         {.help = "RMSProp learning rate of colours at the start",
          .min = 0,
          .max = 10,
          .constant = true});
    bind(
        "fit-rate-sh-end", rate_sh_end,
        {.help = "learning rate of colours at the end", .min = 0, .max = 10, .constant = true});
    bind("tv-density", tv_density,
         {.help =
              "weight of the total variation of densities: smoother surfaces, fewer floaters",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("tv-sh", tv_sh,
         {.help = "weight of the total variation of colours",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("tv-decay", tv_decay,
         {.help = "factor on the weights of total variation at each finer stage",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("tv-fraction", tv_fraction,
         {.help = "fraction of the voxels regularised in a step",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("beta-loss", beta_loss,
         {.help = "weight of a loss that makes rays opaque or clear",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("sparsity-loss", sparsity_loss,
         {.help = "weight of a loss on the densities of a ray's samples; not divided by the "
                  "rays",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("prune-by", prune_by,
         {.help = "removes voxels between stages whose rendering weight is below "
                  "prune-weight / resolution in every view (weight), / the next stage's "
                  "resolution along z (weight-of-next), or whose density is below "
                  "prune-weight (density)",
          .choices = "weight|weight-of-next|density",
          .constant = true});
    bind("prune-weight", prune_weight,
         {.help = "the limit of prune-by", .min = 0, .max = 100, .constant = true});
    bind("prune-last", prune_last,
         {.help =
              "prunes after the last stage, too: smaller files, and less fog in local edits; "
              "views between the photos lose a little",
          .constant = true});
    bind("fit-max-voxels", max_voxels,
         {.unit = "millions of voxels",
          .help = "pruning raises its limit where more would be kept; 0: never",
          .min = 0,
          .max = 2000,
          .constant = true});
    bind("fit-initial-views", initial_views,
         {.unit = "photos",
          .help = "stores what so many photos see; 0 stores the whole box",
          .min = 0,
          .max = 100,
          .constant = true});
    bind("initial-density", initial_density,
         {.unit = "1/radius",
          .help = "initial density everywhere",
          .min = 0,
          .max = 100,
          .constant = true});
    bind("background-layers", background_layers,
         {.unit = "spheres",
          .help = "layers of the background, if the scene needs one; time and memory grow with "
                  "them",
          .min = 2,
          .max = 512,
          .constant = true});
    bind("background-resolution", background_resolution,
         {.unit = "texels",
          .help = "texels from pole to pole of a background sphere in the last stage; memory "
                  "grows with its square",
          .min = 16,
          .max = 4096,
          .constant = true});
    bind("background-grows", background_grows,
         {.help = "the background's resolution grows from stage to stage, as the grid's",
          .constant = true});
    bind("background-rate-density", rate_background_density,
         {.help = "RMSProp learning rate of the background's densities at the start",
          .min = 0,
          .max = 1e4,
          .constant = true});
    bind("background-rate-density-end", rate_background_density_end,
         {.help = "learning rate of the background's densities at the end",
          .min = 0,
          .max = 1e4,
          .constant = true});
    bind("background-rate-color", rate_background_color,
         {.help = "RMSProp learning rate of the background's colours at the start",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("background-rate-color-end", rate_background_color_end,
         {.help = "learning rate of the background's colours at the end",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("background-tv-density", tv_background_density,
         {.help = "weight of the total variation of the background's densities",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("background-tv-color", tv_background_color,
         {.help = "weight of the total variation of the background's colours",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("background-tv-fraction", tv_background_fraction,
         {.help = "fraction of the background regularised in a step",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("background-tv-decays", tv_background_decays,
         {.help = "applies tv-decay to the background, too", .constant = true});
    bind("background-initial-density", initial_background_density,
         {.help = "initial density of all background layers",
          .min = 0,
          .max = 100,
          .constant = true});
    bind("background-lead", background_lead,
         {.unit = "fraction of the first stage",
          .help = "time in which only the background is fitted",
          .min = 0,
          .max = 0.9,
          .constant = true});
    bind("fit-shards", shards,
         {.help = "gradient arenas; 0: one per thread, or 4 with --reproducible",
          .min = 0,
          .max = 64,
          .constant = true});
    bind("fit-exact-sums", exact_sums,
         {.help = "GPU: sums gradients as integers, so that two fits of the same photos are "
                  "bitwise equal; slower, and a third more memory",
          .constant = true});
  }
};

// How the field of a fit is looked at: no ray of the fit ends later.
inline MarchOptions MarchOfField(const FitOptions& options) {
  return {options.step,
          std::min(MarchOptions().stop_transmittance, options.stop_transmittance)};
}

}  // namespace regrade
