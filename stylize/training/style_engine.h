// The work of style training on one processor; TrainNetwork holds the schedule.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/device/backend.h"
#include "kernels/field/radiance_field.h"
#include "kernels/optimize/adam.h"
#include "kernels/render/ray_weigher.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/lipschitz_network.h"
#include "stylize/field/weight_update.h"
#include "stylize/training/train_network_options.h"

namespace regrade {

inline constexpr int kBoundEvery = 25;  // steps between two measurements of the exact bound

// Consecutive training steps.
struct StepRequest {
  int64_t first = 0;               // their first one's number, counted from 0
  std::vector<StyleRays> batches;  // of each step
  // Unless null, called with the network as the first step uses it, after its power iteration.
  // Where it returns true, the iteration is behind the weights and is repeated until it has
  // settled.
  std::function<bool(const LipschitzNetwork&)> norms_lag;
  // Unless null, may be called while a device works on the steps.
  std::function<void()> meanwhile;
};

struct StepResult {
  int64_t made = 0;              // fewer than asked for where training stopped
  AggregationResult last;        // of the last one
  bool stopped = false;          // two in a row, earlier calls' included, were not finite
  std::vector<double> gradient;  // of the last step, if it stopped
};

class StyleEngine {
 public:
  virtual ~StyleEngine() = default;

  virtual StyleLoss* loss() = 0;
  // Of the field, with the loss's min_weight.
  virtual RayWeigher* weigher() = 0;
  virtual int steps_per_call() const = 0;  // largest size of StepRequest::batches
  // Power iteration, loss and gradient, UpdateWeights. `update` is the same in every call.
  virtual StepResult Step(const WeightUpdate& update, const StepRequest& request,
                          LipschitzNetwork* network, AdamState* adam) = 0;
  // What the network makes of the field's appearance; see ApplyNetwork. The last call: a device
  // overwrites its copy of the field.
  virtual Appearance Restyle(const LipschitzNetwork& network,
                             const ProgressFunction& progress) = 0;
};

// The field stays with the caller, unchanged.
std::unique_ptr<StyleEngine> MakeCpuStyleEngine(const RadianceField* field,
                                                const AggregationOptions& loss);
// Uploads the field. rays_per_step: see RaysPerStep in style_rays.h. Throws Error(kResources)
// without CUDA.
std::unique_ptr<StyleEngine> MakeCudaStyleEngine(const RadianceField* field,
                                                 const AggregationOptions& loss,
                                                 int64_t rays_per_step);

std::unique_ptr<StyleEngine> MakeStyleEngine(Backend backend, const RadianceField* field,
                                             const TrainNetworkOptions& options);

}  // namespace regrade
