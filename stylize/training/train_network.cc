#include "stylize/training/train_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/image/decibels.h"
#include "stylize/field/base_map.h"
#include "stylize/training/initial_network.h"
#include "stylize/training/style_rays.h"

namespace regrade {
namespace {

// Random stream of the sample; those of the steps count from 0.
constexpr uint64_t kSampleStream = ~uint64_t{0};

std::string FirstNonFinite(const LipschitzNetwork& network, const std::vector<double>& gradient,
                           double loss) {
  for (int l = 0; l < kNetworkLayers; ++l) {
    const int64_t first = network.weight(l) - network.weight(0);
    const int64_t size = static_cast<int64_t>(network.Outputs(l)) * (network.Inputs(l) + 1) + 1;
    for (int64_t i = first; i < first + size; ++i) {
      const std::string layer = "layer " + std::to_string(l + 1);
      if (!std::isfinite(network.data().parameters[i])) return "the weights of " + layer;
      if (!std::isfinite(gradient[i])) return "the gradient of " + layer;
    }
  }
  return std::isfinite(loss) ? "no tensor, but a gradient is too large to square" : "the loss";
}

// One training from its start or its checkpoint to its result.
class Training {
 public:
  Training(const RadianceField& field, const std::vector<StyledTrainingView>& views,
           const SceneColorMap& scene_map, const TrainNetworkOptions& options,
           StyleEngine* engine)
      : field_(field),
        views_(views),
        scene_map_(scene_map),
        options_(options),
        loss_options_(LossOptions(options, field.march)),
        engine_(*engine),
        // A fixed sample of the training pixels chooses the base and measures the gain.
        sample_(SampleStyleRays(views, 16384, 8, options.seed, kSampleStream)),
        network_(RowOf(field.appearance.basis).basis) {
    bool capped = false;
    const double target = LayerTarget(scene_map.k_est, kNetworkLayers, &capped);
    update_.options = options;
    update_.layer_target = options.no_k_est ? 0 : target;
    result_.k_est = std::min(scene_map.k_est, kLargestKEst);
    if (capped)
      result_.warnings.push_back(
          "K_est is above 1000 and was cut: the 2D method is not smooth");
  }

  void Start(int64_t bad_pixels);
  void Resume(const TrainingState& state);
  // At least one step and at most `most`.
  StepResult Advance(int64_t most);
  TrainNetworkResult Conclude();

  const LipschitzNetwork& network() const { return network_; }
  TrainingState Capture() const {
    TrainingState state = state_;
    state.network = network_.data();
    return state;
  }
  int64_t steps_done() const { return state_.step; }

 private:
  AggregationResult LossOfSample(const LipschitzNetwork& network) {
    return engine_.loss()->Run(network, sample_, nullptr);
  }
  ColorMap ChooseBase();
  // Of those that style-base and the bound allow; mse of the sample.
  ColorMap BetterMap(double* mse);
  // What the colour map leaves of the bound to the residual.
  void LimitResidual();
  void DrawRays(int64_t step);
  // Of the network as a step uses it; true if the power iteration is behind the weights.
  bool RecordBound(const LipschitzNetwork& network);

  const RadianceField& field_;
  const std::vector<StyledTrainingView>& views_;
  const SceneColorMap& scene_map_;
  const TrainNetworkOptions& options_;
  AggregationOptions loss_options_;
  StyleEngine& engine_;
  std::vector<StyleRays> drawn_;  // of the steps from drawn_from_ on
  int64_t drawn_from_ = -1;
  StyleRays sample_;
  WeightUpdate update_;
  LipschitzNetwork network_;
  TrainingState state_;  // without the network, which is network_
  TrainNetworkResult result_;
};

ColorMap Training::BetterMap(double* mse) {
  ColorMap better = scene_map_.map;
  *mse = std::numeric_limits<double>::infinity();
  const auto consider = [&](const ColorMap& map) {
    const double error = LossOfSample(NetworkOfMap(map, network_.row().basis)).Mse();
    if (error < *mse) *mse = error, better = map;
  };
  if (options_.base != "least-squares") consider(scene_map_.map);
  if (options_.base == "mkl") return better;
  const ColorMap least_squares =
      LeastSquaresMap(field_, sample_, loss_options_, engine_.weigher());
  if (options_.bound_factor <= 0 || options_.base == "least-squares" ||
      SpectralNorm(least_squares.matrix) <= options_.bound_factor * result_.k_est)
    consider(least_squares);
  return better;
}

ColorMap Training::ChooseBase() {
  state_.linear_map = BetterMap(&state_.linear_map_mse);
  // Where the 2D method is no colour map, least squares may find a map of large norm, which
  // amplifies every voxel's noise; from the other map the network learns as much.
  const double least_squares = SpectralNorm(state_.linear_map.matrix);
  const bool steep = least_squares > SpectralNorm(scene_map_.map.matrix);
  return options_.base == "best" && steep ? scene_map_.map : state_.linear_map;
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
    // Half of the largest bound: the rest is for training.
    SolveOutputLayer(engine_.loss()->SumHidden(network_, sample_), 2 * result_.k_est,
                     &network_);
  }
  if (!options_.hidden_bias)
    for (int l = 0; l + 1 < kNetworkLayers; ++l)
      std::fill_n(network_.bias(l), network_.Outputs(l), 0.0f);
  if (!options_.settle_norms) network_.RestartNorms();
  if (options_.spectral_normalisation)
    for (int l = 0; l < kNetworkLayers; ++l) network_.k(l) = 1;
  LimitResidual();
  LimitBound(update_, &network_);
}

void Training::LimitResidual() {
  update_.fixed_factor = FixedBoundFactor(network_.data());
  if (options_.bound_factor > 0)
    update_.bound_limit =
        std::max(options_.bound_factor * result_.k_est - network_.BaseNorm(), 1e-3);
}

void Training::Resume(const TrainingState& state) {
  state_ = state;
  network_ = LipschitzNetwork(state.network);
  LimitResidual();
}

bool Training::RecordBound(const LipschitzNetwork& network) {
  state_.history.steps.push_back(state_.step);
  state_.history.bounds.push_back(network.Bound());
  const double drift = network.NormDrift();
  result_.largest_norm_drift = std::max(result_.largest_norm_drift, drift);
  return options_.settle_norms && drift > 0.01 / kNetworkLayers;
}

// The rays of the steps from `step` on, as many as the engine takes before the next measurement
// of the bound.
void Training::DrawRays(int64_t step) {
  const int64_t n = std::min({int64_t{engine_.steps_per_call()},
                              kBoundEvery - step % kBoundEvery, options_.steps - step});
  drawn_from_ = step;
  drawn_.assign(std::max<int64_t>(n, 0), {});
#pragma omp parallel for schedule(dynamic)
  for (int64_t i = 0; i < n; ++i)
    drawn_[i] = options_.rays_per_step > 0
                    ? SampleStyleRays(views_, options_.rays_per_step, options_.patch,
                                      options_.seed, static_cast<uint64_t>(step + i))
                    : WholeViewRays(views_, options_.view_order == "passes", options_.seed,
                                    static_cast<uint64_t>(step + i));
}

StepResult Training::Advance(int64_t most) {
  const int64_t first = state_.step;
  if (drawn_from_ != first) DrawRays(first);
  if (std::ssize(drawn_) > most) drawn_.resize(most);
  StepRequest request{.first = first, .batches = std::exchange(drawn_, {})};
  drawn_from_ = -1;
  if (first % kBoundEvery == 0)
    request.norms_lag = [this](const LipschitzNetwork& network) {
      return RecordBound(network);
    };
  request.meanwhile = [this, next = first + std::ssize(request.batches)] { DrawRays(next); };
  StepResult steps = engine_.Step(update_, request, &network_, &state_.adam);
  state_.step += steps.made;
  const Geometry& geometry = *field_.geometry;
  result_.loss_balance =
      3.0 * static_cast<double>(steps.last.rays) /
      static_cast<double>(geometry.num_voxels() + geometry.spheres.num_texels());
  return steps;
}

TrainNetworkResult Training::Conclude() {
  if (options_.settle_norms) network_.WarmUpNorms();
  // The power iteration's norms are a little low; the guarantee is about exact ones.
  const double excess = network_.LearnedBound() / update_.bound_limit;
  if (excess > 1) network_.k(kNetworkLayers - 1) *= static_cast<float>((1 - 1e-6) / excess);
  double mse = LossOfSample(network_).Mse();
  if (network_.data().has_base && !(mse <= state_.linear_map_mse)) {
    result_.warnings.push_back("the network did not beat the colour map: that alone is used");
    network_.data().base = BetterMap(&mse);
    ClearLastLayer(&network_);
  }
  result_.bound = network_.Bound();
  const LocalLipschitz local = MeasureLocalLipschitz(network_, field_, {.seed = options_.seed});
  result_.local_lipschitz_sampled = local.OnData();
  result_.local_lipschitz = local;
  result_.local_lipschitz_max = std::max(local.ascent, local.steepest_pair);
  result_.smallest_k = network_.SmallestK();
  if (result_.smallest_k < 10 * std::sqrt(kSquareplusB))
    result_.warnings.push_back("a layer's norm has vanished: the network is constant");
  result_.psnr_db = Decibels(mse);
  result_.linear_map = state_.linear_map;
  result_.linear_map_psnr_db = network_.data().has_base ? Decibels(state_.linear_map_mse) : 0;
  result_.steps = state_.step;
  result_.history = std::move(state_.history);
  result_.history.steps.push_back(state_.step);
  result_.history.bounds.push_back(result_.bound);
  result_.rejected_steps = state_.adam.rejected;
  result_.left_out_pixels = state_.left_out_pixels;
  result_.network = std::move(network_);
  return std::move(result_);
}

}  // namespace

TrainNetworkResult TrainNetwork(const RadianceField& field,
                                const std::vector<StyledTrainingView>& views,
                                const SceneColorMap& scene_map,
                                const TrainNetworkOptions& options, const TrainingHooks& hooks,
                                const TrainingState* resume, StyleEngine* engine) {
  const int64_t bad_pixels = ValidateViews(views);
  std::unique_ptr<StyleEngine> on_cpu;
  if (engine == nullptr) {
    on_cpu = MakeStyleEngine(Backend::kCpu, &field, options);
    engine = on_cpu.get();
  }
  Training training(field, views, scene_map, options, engine);
  if (resume != nullptr) {
    training.Resume(*resume);
  } else {
    training.Start(bad_pixels);
    // Whoever watches the training sees the first network soon.
    if (hooks.checkpoint) hooks.checkpoint(training.Capture());
  }
  while (training.steps_done() < options.steps) {
    const int64_t most = std::min<int64_t>(
        options.steps - training.steps_done(),
        hooks.checkpoint_every - training.steps_done() % hooks.checkpoint_every);
    const StepResult steps = training.Advance(most);
    if (steps.stopped) {
      if (hooks.checkpoint) hooks.checkpoint(training.Capture());
      throw SceneError(
          Concat("style training stopped at step ", training.steps_done() - 1,
                 ": two steps in a row were not finite, first in ",
                 FirstNonFinite(training.network(), steps.gradient, steps.last.loss)),
          "", "lower style-rate by --config; the state before it was kept");
    }
    const LoopControl control =
        Report(hooks.progress, training.steps_done(), options.steps,
               Format("%.1f dB on this step's rays", Decibels(steps.last.Mse())));
    const bool last =
        control != LoopControl::kContinue || training.steps_done() == options.steps;
    if (hooks.checkpoint && (last || training.steps_done() % hooks.checkpoint_every == 0))
      hooks.checkpoint(training.Capture());
    if (control == LoopControl::kStop) throw Interrupted();
  }
  return training.Conclude();
}

}  // namespace regrade
