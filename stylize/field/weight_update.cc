#include "stylize/field/weight_update.h"

#include <algorithm>

namespace regrade {

double FixedBoundFactor(const LipschitzNetworkData& data) {
  return std::max(1.0f, data.sh_scale) *
         std::pow(ActivationLipschitz(ActivationByName(data.activation), data.omega),
                  kNetworkLayers - 1);
}

void LimitBound(const WeightUpdate& update, LipschitzNetwork* network) {
  double bound = update.fixed_factor;
  for (int l = 0; l < kNetworkLayers; ++l) bound *= Squareplus<double>(network->k(l));
  const double factor = update.LimitFactor(bound, kNetworkLayers);
  for (int l = 0; l < kNetworkLayers; ++l) network->k(l) *= static_cast<float>(factor);
}

bool UpdateWeights(const WeightUpdate& update, int64_t step, std::vector<double>* gradient,
                   LipschitzNetwork* network, AdamState* adam) {
  for (int l = 0; l < kNetworkLayers; ++l) {
    if (!update.options.hidden_bias && l + 1 < kNetworkLayers)
      std::fill_n(gradient->begin() + (network->bias(l) - network->weight(0)),
                  network->Outputs(l), 0.0);
    double& d_k = (*gradient)[&network->k(l) - network->weight(0)];
    d_k = update.NormGradient(network->k(l), d_k);
  }
  const std::vector<float> gradient32(gradient->begin(), gradient->end());
  std::vector<float>& parameters = network->data().parameters;
  const int64_t size = std::ssize(parameters);
  if (!AdamStep(update.adam, update.Rate(step), {gradient32.data(), size},
                {parameters.data(), size}, adam))
    return false;
  LimitBound(update, network);
  return true;
}

}  // namespace regrade
