// Style training on a CUDA device. Where a step's rays are few enough, whole series of steps
// run there without the host; otherwise the device computes loss and gradient, and the host
// updates the weights. Float sums have no fixed order, so two runs differ in the last bits
// unless exact_sums is set.
#include <memory>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/render/device_ray_weigher.h"
#include "stylize/cuda/device_style.h"
#include "stylize/cuda/device_style_field.h"
#include "stylize/cuda/device_training.h"
#include "stylize/training/host_steps.h"
#include "stylize/training/style_engine.h"
#include "stylize/training/style_rays.h"

namespace regrade {
namespace {

class CudaStyleEngine : public StyleEngine {
 public:
  CudaStyleEngine(const RadianceField* field, const AggregationOptions& loss,
                  int64_t rays_per_step)
      : field_(UploadStyleField(*field)),
        options_(loss),
        rays_per_step_(rays_per_step),
        loss_(MakeDeviceStyleLoss(&field_, loss)) {
    if (field_.splats != nullptr)
      weigher_ = std::make_unique<DeviceRayWeigher>(field_.splats.get(), loss.min_weight);
    else
      weigher_ =
          MakeRayWeigher(*field->geometry, field->near_clip, loss.march, loss.min_weight);
  }

  StyleLoss* loss() override { return loss_.get(); }
  RayWeigher* weigher() override { return weigher_.get(); }
  int steps_per_call() const override { return OnDevice() ? kBoundEvery : 1; }

  StepResult Step(const WeightUpdate& update, const StepRequest& request,
                  LipschitzNetwork* network, AdamState* adam) override {
    if (!OnDevice()) return host_.Make(update, request, loss_.get(), network, adam);
    if (training_ == nullptr)
      training_ = std::make_unique<DeviceTraining>(&field_, options_, update, *network,
                                                   rays_per_step_, steps_per_call());
    training_->Begin(request.first, request.batches, *network, *adam);
    // While the device makes its steps.
    bool lags = false;
    if (request.norms_lag) {
      LipschitzNetwork ahead = *network;
      for (int i = 0; i < update.options.norm_steps; ++i) ahead.StepNorms();
      lags = request.norms_lag(ahead);
    }
    if (request.meanwhile) request.meanwhile();
    DeviceTraining::Steps steps = training_->End(network, adam);
    if (lags) network->WarmUpNorms();
    return {.made = steps.made,
            .last = steps.last,
            .stopped = steps.stopped,
            .gradient = {steps.gradient.begin(), steps.gradient.end()}};
  }

  Appearance Restyle(const LipschitzNetwork& network,
                     const ProgressFunction& progress) override {
    training_.reset();  // their memory is needed
    loss_.reset();
    RestyleOnDevice(network, &field_);
    Appearance restyled = DownloadAppearance(field_);
    if (Report(progress, 1, 1) == LoopControl::kStop) throw Interrupted();
    return restyled;
  }

 private:
  bool OnDevice() const {
    return rays_per_step_ > 0 && !options_.every_voxel &&
           rays_per_step_ <= DeviceTraining::kMostRays;
  }

  DeviceStyleField field_;
  AggregationOptions options_;
  int64_t rays_per_step_;
  std::unique_ptr<StyleLoss> loss_;
  std::unique_ptr<RayWeigher> weigher_;
  std::unique_ptr<DeviceTraining> training_;
  HostSteps host_;
};

}  // namespace

std::unique_ptr<StyleEngine> MakeCudaStyleEngine(const RadianceField* field,
                                                 const AggregationOptions& loss,
                                                 int64_t rays_per_step) {
  return std::make_unique<CudaStyleEngine>(field, loss, rays_per_step);
}

}  // namespace regrade
