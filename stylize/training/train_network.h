// Learning the network that restyles a field from what a 2D method made of each view.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "kernels/base/options.h"
#include "kernels/base/progress.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/optimize/adam.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/local_lipschitz.h"
#include "stylize/linear_map.h"

namespace regrade {

struct TrainNetworkOptions {
  std::string recipe = "standard";
  int steps = 300;
  double rate_first = 7e-4;
  double rate_last = 7e-6;
  double lambda = 2e-4;
  int rays_per_step = 4096;
  int patch = 8;
  float min_weight = 1e-3f;
  std::string base = "best";
  std::string start = "pytorch";
  double bound_factor = 4;
  float sh_scale = 2;
  float position_scale = 8;
  double view_weight = 1;
  int norm_steps = 20;
  std::string activation = "sine";
  float omega = 1.5f;
  bool no_k_est = false;
  bool no_regularisation = false;
  bool spectral_normalisation = false;
  std::string loss_scale = "mean";
  bool every_voxel = false;
  uint64_t seed = 0;  // of the run; not an option of this stage

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("recipe", recipe,
         {.help = "standard: a colour map and a bounded residual; paper: LipRF as published",
          .choices = "standard|paper"});
    bind("style-steps", steps,
         {.unit = "steps",
          .help = "of the style's network; time is proportional",
          .min = 1,
          .max = 1e6});
    bind("style-rate", rate_first, {.help = "first learning rate", .min = 0, .max = 1});
    bind("style-rate-last", rate_last,
         {.help = "last learning rate, reached along a cosine", .min = 0, .max = 1});
    bind("style-lambda", lambda,
         {.help = "weight of the Lipschitz regularisation against the mean squared error",
          .min = 0,
          .max = 1e3});
    bind("style-rays", rays_per_step,
         {.unit = "rays",
          .help = "of a step, in square patches; 0 takes a whole view",
          .min = 0,
          .max = 1e8});
    bind("style-patch", patch,
         {.unit = "pixels",
          .help = "side of a patch; larger ones touch fewer voxels a ray, and learn noisier",
          .min = 1,
          .max = 1024});
    bind("style-min-weight", min_weight,
         {.help =
              "samples of less weight are dropped while learning: faster, and off by at most "
              "their sum",
          .min = 0,
          .max = 0.1});
    bind("style-base", base,
         {.help = "the colour map that the network starts from; best is least squares where it "
                  "is nearer to the 2D method and no steeper than mkl, else mkl",
          .choices = "best|mkl|least-squares|none"});
    bind("style-start", start,
         {.help = "ablation, with --style-base none: the weights that learning begins with; "
                  "pytorch sends all voxels to almost one colour, orthogonal keeps them as far "
                  "apart as they are, identity begins near the colours that are there",
          .choices = "pytorch|orthogonal|identity"});
    bind("style-bound", bound_factor,
         {.help = "largest certified Lipschitz bound, in units of K_est; 0 sets no limit",
          .min = 0,
          .max = 1e6});
    bind("style-position-scale", position_scale,
         {.help = "how strongly the style may vary with position", .min = 0, .max = 100});
    bind("style-sh-scale", sh_scale,
         {.help = "how strongly the style may bend with colour; counts in the bound",
          .min = 0.01,
          .max = 100});
    bind("style-view-weight", view_weight,
         {.help = "price of a style that changes with the direction a point is seen from: 0 is "
                  "nearest to a 2D method that maps every view its own way, and flickers more; "
                  "larger is steadier and less near",
          .min = 0,
          .max = 1e6});
    bind("style-norm-steps", norm_steps,
         {.unit = "steps",
          .help = "of the power iteration for each step of learning",
          .min = 1,
          .max = 1000});
    bind("style-activation", activation,
         {.help =
              "of the hidden layers: sine follows strong styles best; relu and leaky-relu are "
              "piecewise linear and a little less faithful; sigmoid and tanh flatten far from "
              "0 and may stop learning",
          .choices = "sine|relu|leaky-relu|sigmoid|tanh"});
    bind("style-omega", omega,
         {.help = "frequency of the sine; five layers multiply the bound by its fifth power",
          .min = 0.01,
          .max = 100});
    bind("style-no-k-est", no_k_est,
         {.help = "ablation: regularise towards 0, not K_est: a smaller bound, paler "
                  "colours"});
    bind("style-no-regularisation", no_regularisation,
         {.help = "ablation: no Lipschitz regularisation: nearer to the 2D method, and "
                  "noisier where its views disagree; only --style-bound still holds"});
    bind(
        "style-spectral-normalisation", spectral_normalisation,
        {.help = "ablation: every layer's norm is 1, and so is the network's bound: smoothest, "
                 "and weakest in colour"});
    bind("style-loss", loss_scale,
         {.help = "mean over rays and channels, or the paper's sum divided by the voxels",
          .choices = "mean|sum-over-voxels"});
    bind("style-every-voxel", every_voxel,
         {.help =
              "sends every voxel through the network at each step, as the paper's Algorithm 1 "
              "is written, instead of those that the step's rays touch: the same result, "
              "slower; for timing"});
  }
};

// Sets every option that the recipe decides: "standard", or "paper" (LipRF Sec. 5: no colour
// map, PyTorch's default initialisation, a whole view a step, 300 steps, 1e-2 to 1e-4). Call it
// before options are read. Throws Error(kUsage) for another name.
void ApplyStyleRecipe(const std::string& recipe, TrainNetworkOptions* options);

struct StyledTrainingView {
  Camera camera;
  const Image* target = nullptr;  // [H, W, 3] sRGB, at the camera's size; may leave [0, 1]
  const Image* mask = nullptr;    // [H, W, 1] or null: pixels below 0.5 are left out
  std::string name;               // for messages
  // The part of the picture that steps look at, [x0, x1) x [y0, y1); empty stands for all.
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// The scene-wide Monge-Kantorovich map from the photos' colours to the styled ones.
struct SceneColorMap {
  ColorMap map;
  double k_est = 0;  // ||M||_2
};

inline constexpr int kBoundEvery = 25;  // steps between two looks at exact norms

// How the guarantee goes while the network learns.
struct BoundHistory {
  std::vector<int64_t> steps;
  std::vector<double> bounds;  // LipschitzNetwork::Bound() before that step
};

// All that a resumed run needs; N steps, and N more from here, are bitwise 2N steps.
struct TrainingState {
  LipschitzNetworkData network;
  AdamState adam;
  int64_t step = 0;  // done
  double linear_map_mse = 0;
  int64_t left_out_pixels = 0;
  BoundHistory history;
};

struct TrainingHooks {
  ProgressFunction progress;
  std::function<void(const TrainingState&)> checkpoint;  // may be empty
  int checkpoint_every = 50;                             // steps
};

struct TrainNetworkResult {
  LipschitzNetwork network;
  int64_t steps = 0;                   // taken
  double k_est = 0;                    // as used: cut at kLargestKEst
  double bound = 0;                    // LipschitzNetwork::Bound()
  double local_lipschitz_sampled = 0;  // on the field's voxels
  LocalLipschitz slopes;
  double local_lipschitz_max = 0;  // climbed to from there
  double smallest_k = 0;           // of the layers; near 0 a layer is dead
  double largest_norm_drift = 0;   // of the power iteration, seen while learning
  double psnr_db = 0;              // of a fixed sample of training rays to the targets, clipped
  double linear_map_psnr_db = 0;   // the same of linear_map; 0 without a base map
  double mean_touched_voxels = 0;
  ColorMap linear_map;          // the nearer one to the targets, however steep
  int64_t rejected_steps = 0;   // not finite
  int64_t left_out_pixels = 0;  // targets that are not finite
  BoundHistory history;         // every kBoundEvery steps, and the end
  std::vector<std::string> warnings;
};

// `resume`, unless null, is a state that a checkpoint hook was given, of the same inputs.
// Throws Error(kInput) for a target of another size or with more than 1 % of pixels that are
// not finite, Error(kScene) when two steps in a row are not finite. `device_field`, unless
// null, is the same field on a device, where the steps are then made.
TrainNetworkResult TrainNetwork(const RadianceField& field,
                                const std::vector<StyledTrainingView>& views,
                                const SceneColorMap& scene_map, const MarchOptions& march,
                                const TrainNetworkOptions& options, const TrainingHooks& hooks,
                                const TrainingState* resume = nullptr,
                                const DeviceGrid* device_field = nullptr);

}  // namespace regrade
