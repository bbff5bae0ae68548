#include "stylize/train_network.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "kernels/base/error.h"
#include "kernels/network/lipschitz_layer.h"
#include "kernels/optimize/schedule.h"
#include "stylize/base_map.h"
#include "stylize/gradient_aggregation.h"
#include "stylize/initial_network.h"
#include "stylize/lipschitz_regularizer.h"
#include "stylize/observed_slope.h"
#include "stylize/style_rays.h"

namespace regrade {
namespace {

// Of the random numbers that choose the sample; steps count from 0.
constexpr uint64_t kSampleStream = ~uint64_t{0};

double Psnr(double mse) { return -10 * std::log10(std::max(mse, 1e-12)); }

// Shrinks all K_i alike until the product is within `budget`.
void LimitProduct(double budget, LipschitzNetwork* network) {
  const LipschitzNetworkData& data = network->data();
  double product = std::max(1.0f, data.sh_scale) *
                   std::pow(ActivationLipschitz(ActivationByName(data.activation), data.omega),
                            kNetworkLayers - 1);
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

}  // namespace

void ApplyStyleRecipe(const std::string& recipe, TrainNetworkOptions* options) {
  if (recipe != "standard" && recipe != "paper")
    throw Error(ExitCode::kUsage, "unknown recipe '" + recipe + "'", "--recipe",
                "use standard or paper");
  const uint64_t seed = options->seed;
  *options = TrainNetworkOptions{};
  options->seed = seed;
  options->recipe = recipe;
  if (recipe == "standard") return;
  options->base = "none";
  options->steps = 300;
  options->rate_first = 1e-2;
  options->rate_last = 1e-4;
  options->rays_per_step = 0;
  options->min_weight = 0;
  options->sh_scale = 1;
  options->position_scale = 1;
  options->norm_steps = 1;
  options->bound_factor = 0;
}

TrainNetworkResult TrainNetwork(const RadianceField& field,
                                const std::vector<StyledTrainingView>& views,
                                const SceneColorMap& scene_map, const MarchOptions& march,
                                const TrainNetworkOptions& options, const TrainingHooks& hooks,
                                const TrainingState* resume) {
  const bool paper = options.recipe == "paper";
  AggregationOptions aggregation_options{
      .march = march,
      .min_weight = options.min_weight,
      .max_transmittance = paper ? 1.0f : 0.5f,
      .one_sided = !paper,
      .divide_by_voxels = options.loss_scale == "sum-over-voxels"};
  GradientAggregation aggregation(field, aggregation_options);
  // A fixed sample of the training pixels: it chooses the base and says what was gained.
  constexpr int kSampleRays = 16384;
  const int64_t bad_pixels = ValidateViews(views);
  const StyleRays sample = SampleStyleRays(views, kSampleRays, 8, options.seed, kSampleStream);

  TrainNetworkResult result;
  bool capped = false;
  const double layer_target =
      options.no_k_est ? 0 : LayerTarget(scene_map.k_est, kNetworkLayers, &capped);
  result.k_est = std::min(scene_map.k_est, kLargestKEst);
  if (capped)
    result.warnings.push_back("K_est is above 1000 and was cut: the 2D method is not smooth");

  const auto budget_of = [&](const LipschitzNetwork& network) {
    return options.bound_factor > 0
               ? std::max(options.bound_factor * result.k_est - network.BaseNorm(), 1e-3)
               : std::numeric_limits<double>::infinity();
  };

  TrainingState state;
  if (resume != nullptr) {
    state = *resume;
  } else {
    state.left_out_pixels = bad_pixels;
    LipschitzNetwork network;
    network.data().activation = options.activation;
    network.data().omega = options.omega;
    network.data().position_scale = options.position_scale;
    if (options.base == "none") {
      InitializeAsPyTorch(options.seed, &network);
    } else {
      double best = std::numeric_limits<double>::infinity();
      const auto consider = [&](const ColorMap& map) {
        const double mse = aggregation.Run(NetworkOfMap(map), sample, nullptr).Mse();
        if (mse < best) best = mse, network.data().base = map;
      };
      if (options.base != "least-squares") consider(scene_map.map);
      if (options.base != "mkl") consider(LeastSquaresMap(field, sample, aggregation_options));
      network.data().has_base = true;
      state.linear_map_mse = best;
      network.data().sh_scale = options.sh_scale;
      InitializeResidual(options.seed, &network);
      SolveOutputLayer(aggregation.SumHidden(network, sample), 2 * result.k_est, &network);
    }
    if (options.spectral_normalisation)
      for (int l = 0; l < kNetworkLayers; ++l) network.k(l) = 1;
    LimitProduct(budget_of(network), &network);
    state.network = network.data();
  }
  LipschitzNetwork network(state.network);
  const double budget = budget_of(network);

  const auto capture = [&] {
    state.network = network.data();
    return state;
  };
  int rejected_in_a_row = 0;
  double touched = 0;
  int64_t touched_steps = 0;
  while (state.step < options.steps) {
    for (int i = 0; i < options.norm_steps; ++i) network.StepNorms();
    if (state.step % 25 == 0) {
      const double drift = network.NormDrift();
      result.largest_norm_drift = std::max(result.largest_norm_drift, drift);
      if (drift > 0.01 / kNetworkLayers) network.WarmUpNorms();
    }
    const StyleRays batch = SampleStyleRays(views, options.rays_per_step, options.patch,
                                            options.seed, static_cast<uint64_t>(state.step));
    std::vector<double> gradient(static_cast<size_t>(LipschitzNetwork::NumParameters()));
    const AggregationResult step = aggregation.Run(network, batch, &gradient);
    touched += static_cast<double>(step.touched_voxels);
    ++touched_steps;
    for (int l = 0; l < kNetworkLayers; ++l) {
      double& d_k = gradient[static_cast<size_t>(&network.k(l) - network.weight(0))];
      if (options.spectral_normalisation)
        d_k = 0;
      else if (!options.no_regularisation)
        d_k += options.lambda * LipschitzPenaltyDerivative(network.k(l), layer_target);
    }
    const std::vector<float> gradient32(gradient.begin(), gradient.end());
    std::vector<float>& parameters = network.data().parameters;
    const int64_t size = static_cast<int64_t>(parameters.size());
    const double rate =
        CosineAnnealing(state.step, options.steps, options.rate_first, options.rate_last);
    if (AdamStep({}, rate, {gradient32.data(), size}, {parameters.data(), size}, &state.adam)) {
      rejected_in_a_row = 0;
      if (!options.spectral_normalisation) LimitProduct(budget, &network);
    } else if (++rejected_in_a_row == 2) {
      if (hooks.checkpoint) hooks.checkpoint(capture());
      throw Error(ExitCode::kScene,
                  "learning the style stopped at step " + std::to_string(state.step) +
                      ": two steps in a row were not finite, first in " +
                      FirstNonFinite(network, gradient, step.loss),
                  "", "lower --style-rate; the state before it was kept");
    }
    ++state.step;
    char note[64];
    std::snprintf(note, sizeof note, "%.1f dB on this step's rays", Psnr(step.Mse()));
    const Verdict verdict = Report(hooks.progress, static_cast<double>(state.step),
                                   static_cast<double>(options.steps), note);
    const bool last = verdict != Verdict::kContinue || state.step == options.steps;
    if (hooks.checkpoint && (last || state.step % hooks.checkpoint_every == 0))
      hooks.checkpoint(capture());
    if (verdict == Verdict::kAbort) throw Interrupted();
    if (verdict == Verdict::kFinish) break;
  }

  network.WarmUpNorms();
  double mse = aggregation.Run(network, sample, nullptr).Mse();
  if (network.data().has_base && !(mse <= state.linear_map_mse)) {
    result.warnings.push_back("the network did not beat the colour map: the map alone is used");
    float* last_weight = network.weight(kNetworkLayers - 1);
    std::fill(last_weight, &network.k(kNetworkLayers - 1), 0.0f);  // and its bias
    mse = state.linear_map_mse;
  }
  // The power iteration's norms are a little low; the promise is about exact ones.
  const double excess = network.ResidualBound() / budget;
  if (excess > 1) network.k(kNetworkLayers - 1) *= static_cast<float>((1 - 1e-6) / excess);
  result.bound = network.Bound();
  result.slope_observed = ObserveSlopes(network, field, {.seed = options.seed}).OnData();
  result.smallest_k = network.SmallestK();
  if (result.smallest_k < 10 * std::sqrt(kSquareplusB))
    result.warnings.push_back("a layer's norm has vanished: the network is constant");
  result.psnr_db = Psnr(mse);
  result.linear_map_psnr_db = network.data().has_base ? Psnr(state.linear_map_mse) : 0;
  result.steps = state.step;
  result.mean_touched_voxels =
      touched_steps > 0 ? touched / static_cast<double>(touched_steps) : 0;
  result.rejected_steps = state.adam.rejected;
  result.left_out_pixels = state.left_out_pixels;
  result.network = std::move(network);
  return result;
}

}  // namespace regrade
