#include "stylize/training/train_network.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>

#include "kernels/base/error.h"
#include "kernels/network/lipschitz_layer.h"
#include "kernels/optimize/schedule.h"
#include "stylize/cuda/device_style.h"
#include "stylize/cuda/device_training.h"
#include "stylize/field/base_map.h"
#include "stylize/field/gradient_aggregation.h"
#include "stylize/field/local_lipschitz.h"
#include "stylize/training/initial_network.h"
#include "stylize/training/lipschitz_regularizer.h"
#include "stylize/training/style_rays.h"

namespace regrade {
namespace {

// Of the random numbers that choose the sample; steps count from 0.
constexpr uint64_t kSampleStream = ~uint64_t{0};

double Psnr(double mse) { return -10 * std::log10(std::max(mse, 1e-12)); }

// What the bound has beside the product of squareplus(K_i).
double FixedFactor(const LipschitzNetworkData& data) {
  return std::max(1.0f, data.sh_scale) *
         std::pow(ActivationLipschitz(ActivationByName(data.activation), data.omega),
                  kNetworkLayers - 1);
}

// Shrinks all K_i alike until the product is within `budget`.
void LimitProduct(double budget, LipschitzNetwork* network) {
  double product = FixedFactor(network->data());
  for (int l = 0; l < kNetworkLayers; ++l) product *= Squareplus<double>(network->k(l));
  if (!(product > budget)) return;
  const double factor = std::pow(budget / product, 1.0 / kNetworkLayers);
  for (int l = 0; l < kNetworkLayers; ++l) network->k(l) *= static_cast<float>(factor);
}

std::string FirstNonFinite(const LipschitzNetwork& network, const std::vector<double>& gradient,
                           double loss) {
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t first = network.weight(l) - network.weight(0);
    const int64_t size =
        static_cast<int64_t>(LipschitzNetwork::Outputs(l)) * (LipschitzNetwork::Inputs(l) + 1) +
        1;
    for (int64_t i = first; i < first + size; ++i) {
      const std::string layer = "layer " + std::to_string(l + 1);
      if (!std::isfinite(network.data().parameters[static_cast<size_t>(i)]))
        return "the weights of " + layer;
      if (!std::isfinite(gradient[static_cast<size_t>(i)])) return "the gradient of " + layer;
    }
  }
  return std::isfinite(loss) ? "no tensor, but a gradient is too large to square" : "the loss";
}

// One training from its start or its checkpoint to its result.
class Training {
 public:
  Training(const RadianceField& field, const std::vector<StyledTrainingView>& views,
           const SceneColorMap& scene_map, const MarchOptions& march,
           const TrainNetworkOptions& options, const DeviceGrid* device_field)
      : field_(field),
        views_(views),
        scene_map_(scene_map),
        options_(options),
        aggregation_options_{.march = march,
                             .min_weight = options.min_weight,
                             .max_transmittance = options.recipe == "paper" ? 1.0f : 0.5f,
                             .one_sided = options.recipe != "paper",
                             .view_weight = options.view_weight,
                             .divide_by_voxels = options.loss_scale == "sum-over-voxels",
                             .every_voxel = options.every_voxel},
        loss_(device_field != nullptr
                  ? MakeDeviceStyleLoss(device_field, aggregation_options_)
                  : std::make_unique<GradientAggregation>(field, aggregation_options_)),
        device_field_(device_field),
        // A fixed sample of the training pixels chooses the base and says what was gained.
        sample_(SampleStyleRays(views, 16384, 8, options.seed, kSampleStream)) {
    bool capped = false;
    const double target = LayerTarget(scene_map.k_est, kNetworkLayers, &capped);
    layer_target_ = options.no_k_est ? 0 : target;
    result_.k_est = std::min(scene_map.k_est, kLargestKEst);
    if (capped)
      result_.warnings.push_back(
          "K_est is above 1000 and was cut: the 2D method is not smooth");
  }

  void Start(int64_t bad_pixels);
  void Resume(const TrainingState& state);
  // One step, or on a device as many as go without a look at the norms, up to `most`. False if
  // two in a row were not finite and changed nothing; *last and *gradient are the last one's.
  bool Advance(int64_t most, AggregationResult* last, std::vector<double>* gradient);
  TrainNetworkResult Conclude();

  const LipschitzNetwork& network() const { return network_; }
  TrainingState Capture() const {
    TrainingState state = state_;
    state.network = network_.data();
    return state;
  }
  int64_t steps_done() const { return state_.step; }

 private:
  ColorMap ChooseBase();
  // Of those that --style-base and the bound allow; mse of the sample.
  ColorMap BetterMap(double* mse);
  bool Step(AggregationResult* step, std::vector<double>* gradient);
  bool StepsOnDevice(int64_t most, AggregationResult* last, std::vector<double>* gradient);
  void DrawAhead(int64_t step);
  // Of the network as a step uses it; true if the power iteration lags behind.
  bool LookAtBound(const LipschitzNetwork& ahead);
  // Rays of a step, if it takes patches.
  int64_t RaysOfPatches() const {
    const int64_t square = int64_t{options_.patch} * options_.patch;
    return std::max<int64_t>(1, options_.rays_per_step / square) * square;
  }
  bool StepsStayOnDevice() const {
    return device_field_ != nullptr && options_.rays_per_step > 0 && !options_.every_voxel &&
           RaysOfPatches() <= DeviceTraining::kMostRays;
  }
  // What the certified bound leaves to the residual.
  double Budget() const {
    if (options_.bound_factor <= 0) return std::numeric_limits<double>::infinity();
    return std::max(options_.bound_factor * result_.k_est - network_.BaseNorm(), 1e-3);
  }

  const RadianceField& field_;
  const std::vector<StyledTrainingView>& views_;
  const SceneColorMap& scene_map_;
  const TrainNetworkOptions& options_;
  AggregationOptions aggregation_options_;
  std::unique_ptr<StyleLoss> loss_;
  const DeviceGrid* device_field_;
  std::unique_ptr<DeviceTraining> on_device_;
  std::vector<StyleRays> drawn_;  // of the steps from drawn_from_ on
  int64_t drawn_from_ = -1;
  StyleRays sample_;
  double layer_target_ = 0;
  LipschitzNetwork network_;
  TrainingState state_;  // but for the network, which is network_
  TrainNetworkResult result_;
  double touched_ = 0;
  int64_t steps_here_ = 0;
  int rejected_in_a_row_ = 0;
};

ColorMap Training::BetterMap(double* mse) {
  ColorMap better = scene_map_.map;
  *mse = std::numeric_limits<double>::infinity();
  const auto consider = [&](const ColorMap& map) {
    const double error = loss_->Run(NetworkOfMap(map), sample_, nullptr).Mse();
    if (error < *mse) *mse = error, better = map;
  };
  if (options_.base != "least-squares") consider(scene_map_.map);
  if (options_.base == "mkl") return better;
  const ColorMap least_squares = LeastSquaresMap(field_, sample_, aggregation_options_);
  if (options_.bound_factor <= 0 || options_.base == "least-squares" ||
      SpectralNorm(least_squares.matrix) <= options_.bound_factor * result_.k_est)
    consider(least_squares);
  return better;
}

ColorMap Training::ChooseBase() {
  result_.linear_map = BetterMap(&state_.linear_map_mse);
  // Where the 2D method is no colour map, least squares may find a steep one, and every voxel
  // pays for it in the slope and in noise; from the other map the network learns as much.
  const double least_squares = SpectralNorm(result_.linear_map.matrix);
  const bool steep = least_squares > SpectralNorm(scene_map_.map.matrix);
  return options_.base == "best" && steep ? scene_map_.map : result_.linear_map;
}

void Training::Start(int64_t bad_pixels) {
  state_.left_out_pixels = bad_pixels;
  LipschitzNetworkData& data = network_.data();
  data.activation = options_.activation;
  data.omega = options_.omega;
  data.sh_scale = options_.sh_scale;
  data.position_scale = options_.position_scale;
  if (options_.base == "none") {
    InitializeWithoutMap(options_.start, options_.seed, &network_);
  } else {
    data.base = ChooseBase();
    data.has_base = true;
    InitializeResidual(options_.seed, &network_);
    // Half of the largest bound: the rest is for learning.
    SolveOutputLayer(loss_->SumHidden(network_, sample_), 2 * result_.k_est, &network_);
  }
  if (options_.spectral_normalisation)
    for (int l = 0; l < kNetworkLayers; ++l) network_.k(l) = 1;
  else
    LimitProduct(Budget(), &network_);
}

void Training::Resume(const TrainingState& state) {
  state_ = state;
  network_ = LipschitzNetwork(state.network);
}

bool Training::Advance(int64_t most, AggregationResult* last, std::vector<double>* gradient) {
  if (StepsStayOnDevice()) return StepsOnDevice(most, last, gradient);
  rejected_in_a_row_ = Step(last, gradient) ? 0 : rejected_in_a_row_ + 1;
  return rejected_in_a_row_ < 2;
}

bool Training::LookAtBound(const LipschitzNetwork& ahead) {
  state_.history.steps.push_back(state_.step);
  state_.history.bounds.push_back(ahead.Bound());
  const double drift = ahead.NormDrift();
  result_.largest_norm_drift = std::max(result_.largest_norm_drift, drift);
  return drift > 0.01 / kNetworkLayers;
}

// The rays of the steps from `step` to the next look at the norms.
void Training::DrawAhead(int64_t step) {
  const int64_t n = std::min<int64_t>(kBoundEvery - step % kBoundEvery, options_.steps - step);
  drawn_from_ = step;
  drawn_.assign(static_cast<size_t>(std::max<int64_t>(n, 0)), {});
#pragma omp parallel for schedule(dynamic)
  for (int64_t i = 0; i < n; ++i)
    drawn_[static_cast<size_t>(i)] =
        SampleStyleRays(views_, options_.rays_per_step, options_.patch, options_.seed,
                        static_cast<uint64_t>(step + i));
}

bool Training::StepsOnDevice(int64_t most, AggregationResult* last,
                             std::vector<double>* gradient) {
  if (on_device_ == nullptr) {
    const bool pulled = !options_.no_regularisation && !options_.spectral_normalisation;
    const LipschitzRule rule{
        .steps = options_.steps,
        .rate_first = options_.rate_first,
        .rate_last = options_.rate_last,
        .norm_steps = options_.norm_steps,
        .lambda = pulled ? options_.lambda : 0,
        .layer_target = layer_target_,
        .fixed_norms = options_.spectral_normalisation,
        .product_limit = Budget() / FixedFactor(network_.data()),
        .input_scale = network_.data().sh_scale,
        .scaled_inputs = kNetworkSh,
        .loss_divisor = aggregation_options_.divide_by_voxels
                            ? static_cast<double>(field_.geometry->num_voxels())
                            : 0};
    on_device_ = std::make_unique<DeviceTraining>(device_field_, aggregation_options_, rule,
                                                  network_, RaysOfPatches(), kBoundEvery);
  }
  if (drawn_from_ != state_.step) DrawAhead(state_.step);
  if (static_cast<int64_t>(drawn_.size()) > most) drawn_.resize(static_cast<size_t>(most));
  LipschitzNetwork ahead = network_;
  on_device_->Begin(state_.step, drawn_, network_, state_.adam);
  // While the device makes its steps: what it did not wait for.
  bool lags = false;
  if (state_.step % kBoundEvery == 0) {
    for (int i = 0; i < options_.norm_steps; ++i) ahead.StepNorms();
    lags = LookAtBound(ahead);
  }
  DrawAhead(state_.step + static_cast<int64_t>(drawn_.size()));
  const DeviceTraining::Steps steps = on_device_->End(&network_, &state_.adam);
  if (lags) network_.WarmUpNorms();
  state_.step += steps.made;
  steps_here_ += steps.made;
  touched_ += steps.touched_voxels;
  *last = steps.last;
  gradient->assign(steps.gradient.begin(), steps.gradient.end());
  return !steps.stopped;
}

bool Training::Step(AggregationResult* step, std::vector<double>* gradient) {
  for (int i = 0; i < options_.norm_steps; ++i) network_.StepNorms();
  if (state_.step % kBoundEvery == 0 && LookAtBound(network_)) network_.WarmUpNorms();
  const StyleRays batch = SampleStyleRays(views_, options_.rays_per_step, options_.patch,
                                          options_.seed, static_cast<uint64_t>(state_.step));
  gradient->assign(static_cast<size_t>(LipschitzNetwork::NumParameters()), 0.0);
  *step = loss_->Run(network_, batch, gradient);
  touched_ += static_cast<double>(step->touched_voxels);
  ++steps_here_;
  for (int l = 0; l < kNetworkLayers; ++l) {
    double& d_k = (*gradient)[static_cast<size_t>(&network_.k(l) - network_.weight(0))];
    if (options_.spectral_normalisation)
      d_k = 0;
    else if (!options_.no_regularisation)
      d_k += options_.lambda * LipschitzPenaltyDerivative(network_.k(l), layer_target_);
  }
  const std::vector<float> gradient32(gradient->begin(), gradient->end());
  std::vector<float>& parameters = network_.data().parameters;
  const int64_t size = static_cast<int64_t>(parameters.size());
  const double rate =
      CosineAnnealing(state_.step, options_.steps, options_.rate_first, options_.rate_last);
  ++state_.step;
  if (!AdamStep({}, rate, {gradient32.data(), size}, {parameters.data(), size}, &state_.adam))
    return false;
  if (!options_.spectral_normalisation) LimitProduct(Budget(), &network_);
  return true;
}

TrainNetworkResult Training::Conclude() {
  network_.WarmUpNorms();
  double mse = loss_->Run(network_, sample_, nullptr).Mse();
  if (network_.data().has_base && !(mse <= state_.linear_map_mse)) {
    result_.warnings.push_back("the network did not beat the colour map: that alone is used");
    network_.data().base = BetterMap(&mse);
    ClearLastLayer(&network_);
  }
  // The power iteration's norms are a little low; the guarantee is about exact ones.
  const double excess = network_.ResidualBound() / Budget();
  if (excess > 1) network_.k(kNetworkLayers - 1) *= static_cast<float>((1 - 1e-6) / excess);
  result_.bound = network_.Bound();
  const LocalLipschitz slopes =
      MeasureLocalLipschitz(network_, field_, {.seed = options_.seed});
  result_.local_lipschitz_sampled = slopes.OnData();
  result_.slopes = slopes;
  result_.local_lipschitz_max = std::max(slopes.ascent, slopes.steepest_pair);
  result_.smallest_k = network_.SmallestK();
  if (result_.smallest_k < 10 * std::sqrt(kSquareplusB))
    result_.warnings.push_back("a layer's norm has vanished: the network is constant");
  result_.psnr_db = Psnr(mse);
  result_.linear_map_psnr_db = network_.data().has_base ? Psnr(state_.linear_map_mse) : 0;
  result_.steps = state_.step;
  result_.history = std::move(state_.history);
  result_.history.steps.push_back(state_.step);
  result_.history.bounds.push_back(result_.bound);
  result_.mean_touched_voxels =
      steps_here_ > 0 ? touched_ / static_cast<double>(steps_here_) : 0;
  result_.rejected_steps = state_.adam.rejected;
  result_.left_out_pixels = state_.left_out_pixels;
  result_.network = std::move(network_);
  return std::move(result_);
}

}  // namespace

TrainNetworkResult TrainNetwork(const RadianceField& field,
                                const std::vector<StyledTrainingView>& views,
                                const SceneColorMap& scene_map, const MarchOptions& march,
                                const TrainNetworkOptions& options, const TrainingHooks& hooks,
                                const TrainingState* resume, const DeviceGrid* device_field) {
  const int64_t bad_pixels = ValidateViews(views);
  Training training(field, views, scene_map, march, options, device_field);
  if (resume != nullptr)
    training.Resume(*resume);
  else
    training.Start(bad_pixels);
  while (training.steps_done() < options.steps) {
    AggregationResult step;
    std::vector<double> gradient;
    const int64_t most = std::min<int64_t>(
        options.steps - training.steps_done(),
        hooks.checkpoint_every - training.steps_done() % hooks.checkpoint_every);
    if (!training.Advance(most, &step, &gradient)) {
      if (hooks.checkpoint) hooks.checkpoint(training.Capture());
      throw Error(ExitCode::kScene,
                  "learning the style stopped at step " +
                      std::to_string(training.steps_done() - 1) +
                      ": two steps in a row were not finite, first in " +
                      FirstNonFinite(training.network(), gradient, step.loss),
                  "", "lower --style-rate; the state before it was kept");
    }
    char note[64];
    std::snprintf(note, sizeof note, "%.1f dB on this step's rays", Psnr(step.Mse()));
    const LoopControl control =
        Report(hooks.progress, static_cast<double>(training.steps_done()),
               static_cast<double>(options.steps), note);
    const bool last =
        control != LoopControl::kContinue || training.steps_done() == options.steps;
    if (hooks.checkpoint && (last || training.steps_done() % hooks.checkpoint_every == 0))
      hooks.checkpoint(training.Capture());
    if (control == LoopControl::kStop) throw Interrupted();
  }
  return training.Conclude();
}

}  // namespace regrade
