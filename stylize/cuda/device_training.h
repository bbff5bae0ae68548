// Steps of learning a style that a CUDA device makes on its own: which voxels are touched, the
// network's loss and gradient, and the weights' step are recorded once and played, and the host
// looks only now and then. The same steps as those of train_network.cc, but for the order of
// float sums; the parity table holds them to each other.
#pragma once

#include <memory>
#include <vector>

#include "kernels/field/cuda/device_grid.h"
#include "stylize/cuda/device_lipschitz.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {

class DeviceTraining {
 public:
  // `most_steps`: of one call of Begin. Steps take rays_per_step rays, at most kMostRays.
  DeviceTraining(const DeviceGrid* grid, const AggregationOptions& options,
                 const LipschitzRule& rule, const LipschitzNetwork& network,
                 int64_t rays_per_step, int64_t most_steps);
  ~DeviceTraining();

  static constexpr int64_t kMostRays = 1 << 16;

  // Starts the steps first, first + 1, ... of these rays (fewer than rays_per_step are filled
  // up with rays that do not count). Does not wait: the next steps' rays can be drawn
  // meanwhile.
  void Begin(int64_t first, const std::vector<StyleRays>& batches,
             const LipschitzNetwork& network, const AdamState& adam);

  struct Steps {
    int64_t made = 0;             // fewer than begun where two in a row were not finite
    AggregationResult last;       // of the last one
    double touched_voxels = 0;    // summed over the steps
    bool stopped = false;         // two in a row were not finite
    std::vector<float> gradient;  // of the last step, if it stopped
  };
  // Waits, and gives the weights and moments after the last step.
  Steps End(LipschitzNetwork* network, AdamState* adam);

  // Times that the steps' memory was too small, and was made larger.
  int64_t regrown() const;
  // For tests: as if so few samples and voxels had been expected.
  void ForgetCapacity(int64_t samples, int64_t voxels);

 private:
  class Recording;
  std::unique_ptr<Recording> recording_;
};

}  // namespace regrade
