// One training step of the network's weights: learning rate, regularisation, Adam, and the
// limit of the Lipschitz bound. The CPU and the CUDA kernels use the same formulas.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "kernels/base/host_device.h"
#include "kernels/base/options.h"
#include "kernels/optimize/adam.h"
#include "kernels/optimize/schedule.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/lipschitz_regularizer.h"

namespace regrade {

// Plain numbers, so that a kernel takes them as they are.
struct WeightUpdateOptions {
  int steps = 300;
  double rate_first = 7e-4;
  double rate_last = 7e-6;
  double lambda = 2e-4;
  int norm_steps = 20;
  bool settle_norms = true;
  bool hidden_bias = true;
  bool no_regularisation = false;
  bool spectral_normalisation = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("style-steps", steps,
         {.unit = "steps",
          .help = "training steps of the style's network; time is proportional",
          .min = 1,
          .max = 1e6});
    bind("style-rate", rate_first,
         {.help = "initial learning rate", .min = 0, .max = 1, .constant = true});
    bind("style-rate-last", rate_last,
         {.help = "final learning rate, reached along a cosine",
          .min = 0,
          .max = 1,
          .constant = true});
    bind("style-lambda", lambda,
         {.help = "weight of the Lipschitz regularisation against the mean squared error",
          .min = 0,
          .max = 1e3,
          .constant = true});
    bind("style-norm-steps", norm_steps,
         {.unit = "steps",
          .help = "steps of the power iteration before each training step",
          .min = 1,
          .max = 1000,
          .constant = true});
    bind("style-settle-norms", settle_norms,
         {.help = "lets the power iteration settle at the start, at the end, and where its "
                  "estimate lags behind the weights",
          .constant = true});
    bind("style-hidden-bias", hidden_bias,
         {.help = "hidden layers have biases; LipRF's proposition on networks assumes none",
          .constant = true});
    bind("style-no-regularisation", no_regularisation,
         {.help = "ablation: no Lipschitz regularisation: closer to the 2D method, and noisier "
                  "where its views disagree; only style-bound limits the bound",
          .constant = true});
    bind("style-spectral-normalisation", spectral_normalisation,
         {.help = "ablation: every layer's norm is 1, or as much less as style-bound asks; "
                  "smoothest, and weakest in colour",
          .constant = true});
  }
};

// What does not change from step to step.
struct WeightUpdate {
  WeightUpdateOptions options;
  AdamOptions adam;
  double layer_target = 0;  // of every squareplus(K_i), see EQ(liprf-regularizer)
  // fixed_factor times the product of all squareplus(K_i), the residual's bound, stays below
  // bound_limit.
  double fixed_factor = 1;
  double bound_limit = std::numeric_limits<double>::infinity();

  HD double Rate(int64_t step) const {
    return CosineAnnealing(step, options.steps, options.rate_first, options.rate_last);
  }
  // The derivative by K of loss and regularisation; `d_k` is the loss's.
  HD double NormGradient(double k, double d_k) const {
    if (options.spectral_normalisation) return 0;
    if (options.no_regularisation) return d_k;
    return d_k + options.lambda * LipschitzPenaltyDerivative(k, layer_target);
  }
  // All K_i of `layers` layers are multiplied by this after a step; `bound` is the residual's.
  HD double LimitFactor(double bound, int layers) const {
    using std::pow;
    if (!(bound > bound_limit)) return 1;
    return pow(bound_limit / bound, 1.0 / layers);
  }
};

// The residual's bound beside the product of all squareplus(K_i).
double FixedBoundFactor(const LipschitzNetworkData& data);

// Shrinks all K_i by the same factor until the residual's bound is within its limit.
void LimitBound(const WeightUpdate& update, LipschitzNetwork* network);

// Step `step`, counted from 0, along `gradient` [network->NumParameters()], to which
// the regularisation is added. False if the gradient is not finite: then nothing changes but
// adam->rejected.
bool UpdateWeights(const WeightUpdate& update, int64_t step, std::vector<double>* gradient,
                   LipschitzNetwork* network, AdamState* adam);

}  // namespace regrade
