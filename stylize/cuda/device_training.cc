#include "stylize/cuda/device_training.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "kernels/device/device_graph.h"
#include "stylize/cuda/device_batches.h"
#include "stylize/cuda/device_color_loss.h"
#include "stylize/cuda/device_ray_weights.h"
#include "stylize/field/base_map.h"

namespace regrade {
namespace {

std::vector<std::pair<int, int>> LayerShapes(const LipschitzNetwork& network) {
  std::vector<std::pair<int, int>> shapes;
  for (int l = 0; l < kNetworkLayers; ++l)
    shapes.emplace_back(network.Outputs(l), network.Inputs(l));
  return shapes;
}

// What a summed loss is divided by; 0: three times the rays that count.
double LossDivisor(const DeviceStyleField& field, const AggregationOptions& options) {
  return options.divide_by_voxels ? static_cast<double>(NumMapped(field)) : 0;
}

TrainingParams ParamsOf(const DeviceStyleField& field, const AggregationOptions& options,
                        const WeightUpdate& update, const LipschitzNetworkData& network) {
  return {.update = update,
          .input_scale = network.sh_scale,
          .scaled_inputs = NetworkRow{network.basis}.sh(),
          .loss_divisor = LossDivisor(field, options)};
}

}  // namespace

class DeviceTraining::CapturedSteps {
 public:
  CapturedSteps(const DeviceStyleField* field, const AggregationOptions& options,
                const WeightUpdate& update, const LipschitzNetwork& network,
                int64_t rays_per_step, int64_t most_steps)
      : field_(*field),
        options_(options),
        position_scale_(network.data().position_scale),
        has_base_(network.data().has_base),
        base_(BaseOf(network.data())),
        batches_(rays_per_step, most_steps),
        touched_(field->grid),
        slots_(field->grid),
        mlp_(MakeFusedMlp(network.Effective<float>())),
        optimizer_(LayerShapes(network), ParamsOf(*field, options, update, network.data()),
                   mlp_),
        rays_(rays_per_step, "rays"),
        targets_(rays_per_step, "colours of rays"),
        color_(rays_per_step, "colours of rays"),
        d_color_(rays_per_step, "gradients of colours"),
        sums_(1, "sums of a loss"),
        exact_colors_(options.exact_sums ? 6 * rays_per_step : 0, "exact colours of rays"),
        demand_(1, "buffer sizes that a step needed"),
        stats_(most_steps, "statistics of steps") {
    stats_.Zero();
    REGRADE_CHECK_EQ(network.row().basis, field->row().basis);
    REGRADE_CHECK(!field->grid.fitting && !options.every_voxel);
    REGRADE_CHECK(rays_per_step > 0 && rays_per_step <= kMostRays);
  }

  void Begin(int64_t first, const std::vector<StyleRays>& batches,
             const LipschitzNetwork& network, const AdamState& adam) {
    begun_from_ = first;
    begun_ = static_cast<int64_t>(batches.size());
    REGRADE_CHECK(begun_ > 0 && begun_ <= batches_.steps);
    for (int64_t i = 0; i < begun_; ++i)
      CopyBatch(batches[static_cast<size_t>(i)], (first + i) % batches_.steps);
    optimizer_.CopyIn(network.data().parameters, network.data().singular_vectors, adam, first,
                      rejected_in_a_row_);
    demand_.Zero();
    if (field_.splats != nullptr) WeighSplats(batches);
    if (sample_capacity_ == 0) GrowBuffers(batches.front());
    Launch(begun_);
  }

  Steps End(LipschitzNetwork* network, AdamState* adam) {
    OptimizerState state;
    for (;;) {
      state = optimizer_.CopyOut(&network->data().parameters, &network->data().singular_vectors,
                                 adam);
      BufferDemand demand;
      demand_.CopyOut(&demand, 1);
      if (demand.overflowed == 0) break;
      ++regrown_;
      SetCapacity(std::max<int64_t>(sample_capacity_, demand.samples + demand.samples / 2),
                  std::max<int64_t>(slot_capacity_, demand.slots + demand.slots / 2));
      demand_.Zero();
      Launch(begun_from_ + begun_ - state.step);
    }
    rejected_in_a_row_ = state.rejected_in_a_row;
    Steps steps;
    steps.made = state.step - begun_from_;
    steps.stopped = state.halted != 0;
    if (steps.stopped) steps.gradient = optimizer_.Gradient();
    if (steps.made > 0) {
      std::vector<StepStats> stats(static_cast<size_t>(stats_.size()));
      stats_.CopyOut(stats.data(), stats_.size());
      const StepStats& step = stats[static_cast<size_t>((state.step - 1) % stats_.size())];
      steps.last = {step.loss, step.squared_error, static_cast<int64_t>(step.rays),
                    step.touched, step.samples};
      const double voxels = LossDivisor(field_, options_);
      const double divisor = voxels > 0 ? voxels : 3.0 * static_cast<double>(step.rays);
      steps.last.loss = step.rays > 0 ? step.loss / divisor : 0;
    }
    return steps;
  }

  int64_t regrown() const { return regrown_; }

  void SetCapacity(int64_t samples, int64_t slots) {
    sample_capacity_ = samples;
    slot_capacity_ = std::min(slots, field_.grid.num_points());
    weights_ = {};
    weights_.Reserve(rays_.size(), sample_capacity_);
    const int64_t floats = slot_capacity_ * field_.row().stride();
    features_ = {};
    features_ = DeviceBuffer<float>(floats, "features of touched voxels");
    rows_ = {};
    rows_ = DeviceBuffer<float>(floats, "styled voxels");
    d_rows_ = {};
    d_rows_ = DeviceBuffer<float>(floats, "gradients of styled voxels");
    exact_rows_ = {};
    if (options_.exact_sums) exact_rows_ = DeviceBuffer<float>(2 * floats, "exact gradients");
    unclamped_ = {};
    unclamped_ = DeviceBuffer<uint8_t>(sample_capacity_, "clamps of samples");
    mlp_.ReserveAdjoint(slot_capacity_);
    graph_.Capture([&] { Step(); });
  }

 private:
  // One step, in the order of EQ(liprf-loss) and its adjoint.
  void Step() {
    const OptimizerState* state = optimizer_.state();
    TakeBatch(batches_, &state->step, rays_.data(), targets_.data());
    if (field_.splats != nullptr)
      TakeSamples(weighed_, &state->step, &weights_, &touched_);
    else
      weights_.Launch(field_.grid, rays_.data(), rays_.size(), options_.march,
                      options_.min_weight, &touched_);
    slots_.Launch(&touched_);
    ClampToCapacity(slot_capacity_, &weights_, &slots_, demand_.data());
    const int32_t* touched = slots_.counter.data();
    GatherRows(field_, slots_.point_of_slot.data(), 0, slot_capacity_, position_scale_,
               features_.data(), touched);
    optimizer_.ActivateWeights(&mlp_, &demand_.data()->overflowed);
    mlp_.Forward(MlpPrecision::kTensor, features_.data(), slot_capacity_, rows_.data(),
                 touched);
    if (has_base_)
      AddMappedRows(field_.row(), base_.matrix, base_.constant, features_.data(),
                    slot_capacity_, rows_.data(), touched);
    (options_.exact_sums ? exact_rows_ : d_rows_).Zero();
    sums_.Zero();
    BlendColors(field_, weights_, slots_, rays_.data(), rows_.data(), color_.data(),
                unclamped_.data(), exact_colors_.data());
    AddColorLoss(color_.data(), targets_.data(), weights_.transmittance.data(), rays_.size(),
                 {options_.max_transmittance, options_.one_sided}, d_color_.data(),
                 sums_.data());
    BlendColorsAdjoint(field_, weights_, slots_, rays_.data(), unclamped_.data(),
                       d_color_.data(), d_rows_.data(), exact_rows_.data());
    AddViewPenalty(field_.row(), base_.matrix, features_.data(), rows_.data(), slot_capacity_,
                   static_cast<float>(options_.view_weight), d_rows_.data(),
                   &sums_.data()->loss, touched);
    mlp_.AddAdjoint(MlpPrecision::kTensor, features_.data(), d_rows_.data(), slot_capacity_,
                    touched);
    const DeviceColorLoss* sums = sums_.data();
    optimizer_.Update(&mlp_,
                      {&sums->loss, &sums->squared_error, &sums->rays, weights_.counter.data(),
                       touched, &demand_.data()->overflowed},
                      stats_);
  }

  void Launch(int64_t steps) {
    for (int64_t i = 0; i < steps; ++i) graph_.Launch();
  }

  void CopyBatch(const StyleRays& batch, int64_t place) {
    const int64_t n = static_cast<int64_t>(batch.rays.size());
    REGRADE_CHECK(n > 0 && n <= batches_.per_step);
    std::vector<Ray> rays = batch.rays;
    std::vector<Vec3f> targets = batch.targets;
    rays.resize(static_cast<size_t>(batches_.per_step), batch.rays.front());
    targets.resize(static_cast<size_t>(batches_.per_step), Vec3f{NAN, NAN, NAN});
    DeviceCopyIn(batches_.rays.data() + place * batches_.per_step, rays.data(),
                 batches_.per_step * int64_t{sizeof(Ray)});
    DeviceCopyIn(batches_.targets.data() + place * batches_.per_step, targets.data(),
                 batches_.per_step * int64_t{sizeof(Vec3f)});
  }

  // The samples of the steps that begin.
  void WeighSplats(const std::vector<StyleRays>& batches) {
    std::vector<DeviceSplatWeigher::Group> groups(static_cast<size_t>(batches_.steps),
                                                  {nullptr, 0, 0});
    for (int64_t i = 0; i < begun_; ++i) {
      const StyleRays& batch = batches[static_cast<size_t>(i)];
      groups[static_cast<size_t>((begun_from_ + i) % batches_.steps)] = {
          &batch, 0, std::ssize(batch.rays)};
    }
    const int64_t before = weighed_.capacity;
    field_.splats->Weigh(groups, batches_.per_step, options_.min_weight, &weighed_);
    // A captured step reads where the samples were.
    if (sample_capacity_ > 0 && weighed_.capacity != before)
      SetCapacity(sample_capacity_, slot_capacity_);
  }

  // Half as much again as a first batch needs.
  void GrowBuffers(const StyleRays& batch) {
    DeviceRayWeights trial;
    if (field_.splats != nullptr) {
      trial.Reserve(rays_.size(), weighed_.most);
      TakeSamples(weighed_, &optimizer_.state()->step, &trial, &touched_);
    } else {
      rays_.CopyIn(batch.rays.data(), std::ssize(batch.rays));
      trial.March(field_.grid, rays_.data(), std::ssize(batch.rays), options_.march,
                  options_.min_weight, &touched_);
    }
    slots_.Assign(&touched_);
    const int64_t samples = trial.num_samples, slots = slots_.num_slots;
    trial = {};
    SetCapacity(std::max<int64_t>(1024, samples + samples / 2),
                std::max<int64_t>(1024, slots + slots / 2));
  }

  const DeviceStyleField& field_;
  AggregationOptions options_;
  float position_scale_;
  bool has_base_;
  RowMap base_;
  DeviceBatches batches_;
  DeviceSplatSamples weighed_;  // of splats, a group for each step
  DeviceTouched touched_;
  DeviceSlots slots_;
  DeviceRayWeights weights_;
  DeviceMlp mlp_;
  DeviceLipschitz optimizer_;
  DeviceBuffer<Ray> rays_;
  DeviceBuffer<Vec3f> targets_, color_, d_color_;
  DeviceBuffer<DeviceColorLoss> sums_;
  DeviceBuffer<float> exact_colors_, exact_rows_;  // empty without exact sums
  DeviceBuffer<BufferDemand> demand_;
  DeviceBuffer<StepStats> stats_;
  DeviceBuffer<uint8_t> unclamped_;
  DeviceBuffer<float> features_, rows_, d_rows_;  // [slot_capacity_, stride]
  int64_t sample_capacity_ = 0, slot_capacity_ = 0;
  int64_t begun_from_ = 0, begun_ = 0, regrown_ = 0;
  int32_t rejected_in_a_row_ = 0;
  DeviceGraph graph_;
};

DeviceTraining::DeviceTraining(const DeviceStyleField* field, const AggregationOptions& options,
                               const WeightUpdate& update, const LipschitzNetwork& network,
                               int64_t rays_per_step, int64_t most_steps)
    : steps_(std::make_unique<CapturedSteps>(field, options, update, network, rays_per_step,
                                             most_steps)) {}
DeviceTraining::~DeviceTraining() = default;

void DeviceTraining::Begin(int64_t first, const std::vector<StyleRays>& batches,
                           const LipschitzNetwork& network, const AdamState& adam) {
  steps_->Begin(first, batches, network, adam);
}
DeviceTraining::Steps DeviceTraining::End(LipschitzNetwork* network, AdamState* adam) {
  return steps_->End(network, adam);
}
int64_t DeviceTraining::regrown() const { return steps_->regrown(); }
void DeviceTraining::ForgetCapacity(int64_t samples, int64_t voxels) {
  steps_->SetCapacity(samples, voxels);
}

}  // namespace regrade
