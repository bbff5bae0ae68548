// Training steps that run on a CUDA device without the host: the touched voxels, loss, gradient
// and weight update of a step are captured once as a graph and launched again for each step.
// The same steps as those of host_steps.h, but for the order of float sums; the parity table
// compares them. With AggregationOptions::exact_sums the steps of two runs are bitwise equal,
// however often buffers were enlarged.
#pragma once

#include <memory>
#include <vector>

#include "stylize/cuda/device_lipschitz.h"
#include "stylize/cuda/device_style_field.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

class DeviceTraining {
 public:
  // `most_steps`: of one call of Begin. Steps take rays_per_step rays, at most kMostRays.
  DeviceTraining(const DeviceStyleField* field, const AggregationOptions& options,
                 const WeightUpdate& update, const LipschitzNetwork& network,
                 int64_t rays_per_step, int64_t most_steps);
  ~DeviceTraining();

  static constexpr int64_t kMostRays = 1 << 16;

  // Starts the steps first, first + 1, ... of these rays (fewer than rays_per_step are padded
  // with rays that do not count). Does not wait for them; `batches` is not used after the call.
  void Begin(int64_t first, const std::vector<StyleRays>& batches,
             const LipschitzNetwork& network, const AdamState& adam);

  struct Steps {
    int64_t made = 0;             // fewer than started where two in a row were not finite
    AggregationResult last;       // of the last one
    bool stopped = false;         // two in a row were not finite
    std::vector<float> gradient;  // of the last step, if it stopped
  };
  // Waits for the weights and moments after the last step.
  Steps End(LipschitzNetwork* network, AdamState* adam);

  // How often the steps' buffers were too small and were enlarged.
  int64_t regrown() const;
  // For tests: buffers for so few samples and voxels.
  void ForgetCapacity(int64_t samples, int64_t voxels);

 private:
  class CapturedSteps;
  std::unique_ptr<CapturedSteps> steps_;
};

}  // namespace regrade
