// Style training on the CPU, and the steps that a device leaves to the host.
#include "stylize/field/apply_network.h"
#include "stylize/training/host_steps.h"
#include "stylize/training/style_engine.h"
#include "stylize/training/style_rays.h"

namespace regrade {
namespace {

class CpuStyleEngine : public StyleEngine {
 public:
  CpuStyleEngine(const RadianceField* field, const AggregationOptions& loss)
      : field_(*field), loss_(*field, loss) {}

  StyleLoss* loss() override { return &loss_; }
  RayWeigher* weigher() override { return loss_.weigher(); }
  int steps_per_call() const override { return 1; }
  StepResult Step(const WeightUpdate& update, const StepRequest& request,
                  LipschitzNetwork* network, AdamState* adam) override {
    return steps_.Make(update, request, &loss_, network, adam);
  }
  Appearance Restyle(const LipschitzNetwork& network,
                     const ProgressFunction& progress) override {
    return ApplyNetwork(network, field_, progress);
  }

 private:
  const RadianceField& field_;
  GradientAggregation loss_;
  HostSteps steps_;
};

}  // namespace

StepResult HostSteps::Make(const WeightUpdate& update, const StepRequest& request,
                           StyleLoss* loss, LipschitzNetwork* network, AdamState* adam) {
  StepResult result;
  for (const StyleRays& batch : request.batches) {
    for (int i = 0; i < update.options.norm_steps; ++i) network->StepNorms();
    if (result.made == 0 && request.norms_lag && request.norms_lag(*network))
      network->WarmUpNorms();
    std::vector<double> gradient(network->NumParameters(), 0.0);
    result.last = loss->Run(*network, batch, &gradient);
    const int64_t step = request.first + result.made++;
    const bool finite = UpdateWeights(update, step, &gradient, network, adam);
    rejected_in_a_row_ = finite ? 0 : rejected_in_a_row_ + 1;
    if (rejected_in_a_row_ < 2) continue;
    result.stopped = true;
    result.gradient = std::move(gradient);
    break;
  }
  return result;
}

std::unique_ptr<StyleEngine> MakeCpuStyleEngine(const RadianceField* field,
                                                const AggregationOptions& loss) {
  return std::make_unique<CpuStyleEngine>(field, loss);
}

std::unique_ptr<StyleEngine> MakeStyleEngine(Backend backend, const RadianceField* field,
                                             const TrainNetworkOptions& options) {
  const AggregationOptions loss = LossOptions(options, field->march);
  if (backend == Backend::kCpu) return MakeCpuStyleEngine(field, loss);
  return MakeCudaStyleEngine(field, loss, RaysPerStep(options.rays_per_step, options.patch));
}

}  // namespace regrade
