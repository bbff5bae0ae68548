// Trains the network that restyles a field on the 2D method's pictures of its views.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "kernels/optimize/adam.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/local_lipschitz.h"
#include "stylize/linear_map.h"
#include "stylize/training/style_engine.h"
#include "stylize/training/train_network_options.h"

namespace regrade {

struct StyledTrainingView {
  Camera camera;
  const Image* target = nullptr;  // [H, W, 3] sRGB, at the camera's size; may leave [0, 1]
  const Image* mask = nullptr;    // [H, W, 1] or null: pixels below 0.5 are left out
  std::string name;               // for messages
  // Steps draw rays from this part of the picture, [x0, x1) x [y0, y1); empty: from all.
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// The scene-wide Monge-Kantorovich map from the photos' colours to the styled ones.
struct SceneColorMap {
  ColorMap map;
  double k_est = 0;  // ||M||_2
};

// The certified bound over training.
struct BoundHistory {
  std::vector<int64_t> steps;
  std::vector<double> bounds;  // LipschitzNetwork::Bound() before that step
};

// All that a resumed run needs: N steps, and N more from here, are bitwise 2N steps.
struct TrainingState {
  LipschitzNetworkData network;
  AdamState adam;
  int64_t step = 0;     // done
  ColorMap linear_map;  // see TrainNetworkResult
  double linear_map_mse = 0;
  int64_t left_out_pixels = 0;
  BoundHistory history;
};

struct TrainingHooks {
  ProgressFunction progress;
  std::function<void(const TrainingState&)> checkpoint;  // may be empty
  int checkpoint_every = 50;                             // steps; and before the first
};

struct TrainNetworkResult {
  LipschitzNetwork network;
  int64_t steps = 0;                   // made
  double k_est = 0;                    // as used: cut at kLargestKEst
  double bound = 0;                    // LipschitzNetwork::Bound()
  double local_lipschitz_sampled = 0;  // on the field's voxels
  LocalLipschitz local_lipschitz;
  double local_lipschitz_max = 0;  // by gradient ascent from there
  double smallest_k = 0;           // of the layers; near 0 a layer is dead
  double largest_norm_drift = 0;   // of the power iteration, during training
  double psnr_db = 0;              // of a fixed sample of training rays to the targets, clipped
  double linear_map_psnr_db = 0;   // the same of linear_map; 0 without a base map
  // 3 Q / B of a step, rays and channels over what the network maps: the weight that LipRF's
  // sum over voxels gives the colours against the regularisation, beside a mean over rays.
  // Empty if this call made no step.
  std::optional<double> loss_balance;
  ColorMap linear_map;          // the one closer to the targets, however large its norm
  int64_t rejected_steps = 0;   // not finite
  int64_t left_out_pixels = 0;  // targets that are not finite
  BoundHistory history;         // every kBoundEvery steps, and the end
  std::vector<std::string> warnings;
};

// `resume`, unless null, is a state that a checkpoint hook received, of the same inputs.
// `engine`, unless null, was made of the same field and options; null trains on the CPU.
// Throws Error(kInput) for a target of another size or with more than 1 % of pixels that are
// not finite, Error(kScene) when two steps in a row are not finite, Interrupted.
TrainNetworkResult TrainNetwork(const RadianceField& field,
                                const std::vector<StyledTrainingView>& views,
                                const SceneColorMap& scene_map,
                                const TrainNetworkOptions& options, const TrainingHooks& hooks,
                                const TrainingState* resume = nullptr,
                                StyleEngine* engine = nullptr);

}  // namespace regrade
