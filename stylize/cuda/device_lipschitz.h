// The weights of a Lipschitz network on a CUDA device and their training steps, without the
// host: norms and gradient as in kernels/network/lipschitz_layer.h, the step as in
// stylize/field/weight_update.h. The parity table compares them with UpdateWeights.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "kernels/device/device_memory.h"
#include "kernels/network/cuda/device_mlp.h"
#include "kernels/optimize/adam.h"
#include "stylize/field/weight_update.h"

namespace regrade {

// What does not change from step to step.
struct TrainingParams {
  WeightUpdate update;
  float input_scale = 1;  // of the first scaled_inputs inputs
  int scaled_inputs = 0;
  double loss_divisor = 0;  // of the summed loss; 0: 3 x the rays that count
};

// Of one step, before its weights change.
struct StepStats {
  double loss = 0;  // a sum, not yet divided
  double squared_error = 0;
  unsigned long long rays = 0;
  int32_t samples = 0, touched = 0;
};

// Counters of the training, on the device while steps are made.
struct OptimizerState {
  int64_t step = 0;        // done
  int64_t adam_steps = 0;  // of these taken
  int64_t rejected = 0;    // and not taken: the gradient was not finite
  int32_t rejected_in_a_row = 0;
  int32_t halted = 0;  // 1: two in a row were rejected, and no more are made
};

class DeviceLipschitz {
 public:
  // `shapes`: outputs and inputs of each layer, unpadded.
  DeviceLipschitz(const std::vector<std::pair<int, int>>& shapes, const TrainingParams& params,
                  const DeviceMlp& mlp);

  // parameters: by layer W [out, in], bias [out], K; vectors: by layer u [out], v [in].
  void CopyIn(const std::vector<float>& parameters, const std::vector<float>& vectors,
              const AdamState& adam, int64_t step, int32_t rejected_in_a_row);
  OptimizerState CopyOut(std::vector<float>* parameters, std::vector<float>* vectors,
                         AdamState* adam) const;
  std::vector<float> Gradient() const;  // of the last step, regularisation included

  // The power iteration's steps, then the effective weights into `mlp`. Does nothing where
  // Update will not: *skip, on the device, is not 0, or training has halted. Neither waits.
  void ActivateWeights(DeviceMlp* mlp, const int32_t* skip);
  // A step along the gradient that `mlp` has summed, which is then cleared. The pointers are to
  // device memory; their values are written to stats[number of the step % its size]. Does
  // nothing where *skip is not 0.
  struct Step {
    const double* loss;
    const double* squared_error;
    const unsigned long long* rays;
    const int32_t *samples, *touched, *skip;
  };
  void Update(DeviceMlp* mlp, const Step& step, const DeviceBuffer<StepStats>& stats);

  const OptimizerState* state() const { return state_.data(); }

  // What kernels see; defined beside them.
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

  TrainingParams params_;
  Shape shape_;
  DeviceBuffer<float> parameters_, vectors_, first_moment_, second_moment_, gradient_;
  DeviceBuffer<OptimizerState> state_;
  DeviceBuffer<int32_t> not_finite_;
};

}  // namespace regrade
