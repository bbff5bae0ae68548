// Learning the weights of a Lipschitz network on a CUDA device, without the host: norms,
// weights as they act, gradient, regularisation, Adam and the limit of the bound, each as
// kernels/network/lipschitz_layer.h, stylize/training/lipschitz_regularizer.h and
// kernels/optimize/adam.h have it. Held to stylize/training/train_network.cc by the parity
// table.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "kernels/device/device_memory.h"
#include "kernels/network/cuda/device_mlp.h"
#include "kernels/optimize/adam.h"

namespace regrade {

// What does not change from step to step.
struct LipschitzRule {
  int64_t steps = 0;  // of the whole learning; the rate falls along EQ(cosine-annealing)
  double rate_first = 0, rate_last = 0;
  AdamOptions adam;
  int norm_steps = 1;  // of the power iteration before each step
  double lambda = 0;   // of the regularisation towards layer_target; 0 for none
  double layer_target = 0;
  bool fixed_norms = false;  // K does not learn
  double product_limit = 0;  // of all squareplus(K_i); infinite for none
  float input_scale = 1;     // of the first scaled_inputs inputs
  int scaled_inputs = 0;
  double loss_divisor = 0;  // the loss is a sum over this; 0: over 3 x the rays that count
};

// Of one step, as it was before its weights moved.
struct LearnedStep {
  double loss = 0;  // a sum, not yet divided
  double squared_error = 0;
  unsigned long long rays = 0;
  int32_t samples = 0, touched = 0;
};

// Where learning stands; on the device while steps are made.
struct LearningState {
  int64_t step = 0;        // done
  int64_t adam_steps = 0;  // of these taken
  int64_t rejected = 0;    // and not taken, for a gradient that was not finite
  int32_t rejected_in_a_row = 0;
  int32_t halted = 0;  // 1: two in a row were rejected, and no more are made
};

class DeviceLipschitz {
 public:
  // `shapes`: outputs and inputs of each layer, unpadded.
  DeviceLipschitz(const std::vector<std::pair<int, int>>& shapes, const LipschitzRule& rule,
                  const DeviceMlp& mlp);

  // parameters: by layer W [out, in], bias [out], K; vectors: by layer u [out], v [in].
  void CopyIn(const std::vector<float>& parameters, const std::vector<float>& vectors,
              const AdamState& adam, int64_t step, int32_t rejected_in_a_row);
  LearningState CopyOut(std::vector<float>* parameters, std::vector<float>* vectors,
                        AdamState* adam) const;
  std::vector<float> Gradient() const;  // of the last step, regularisation included

  // The power iteration's steps, and weights as they act into `mlp`. Neither this nor Learn
  // waits.
  void ActivateWeights(DeviceMlp* mlp);
  // A step along the gradient that `mlp` has gathered; forgets that. *sums lies on the device
  // and is written to steps[step done before % its size]. Does nothing where *skip is not 0.
  struct Step {
    const double* loss;
    const double* squared_error;
    const unsigned long long* rays;
    const int32_t *samples, *touched, *skip;
  };
  void Learn(DeviceMlp* mlp, const Step& step, const DeviceBuffer<LearnedStep>& steps);

  const LearningState* state() const { return state_.data(); }

  // What kernels see; defined where they are.
  static constexpr int kMaxLayers = 8;
  struct Shape {
    int layers = 0;
    int outputs[kMaxLayers], inputs[kMaxLayers];                               // as they are
    int mlp_outputs[kMaxLayers], mlp_inputs[kMaxLayers];                       // padded
    int parameters[kMaxLayers + 1], vectors[kMaxLayers + 1], mlp[kMaxLayers];  // offsets
  };
  struct View;

 private:
  View GetView() const;

  LipschitzRule rule_;
  Shape shape_;
  DeviceBuffer<float> parameters_, vectors_, first_moment_, second_moment_, gradient_;
  DeviceBuffer<LearningState> state_;
  DeviceBuffer<int32_t> not_finite_;
};

}  // namespace regrade
