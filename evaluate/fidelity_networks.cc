#include "evaluate/fidelity_networks.h"

#include "evaluate/pair_network.h"

namespace regrade {

void OpenNetworks(const ConsistencyOptions& options, FidelityTargets* targets) {
  targets->perceptual = PerceptualDistance(options.lpips);
  targets->edges = EdgeMaps(options.edges);
  if (targets->style == nullptr) return;
  const auto features = OpenImageNetwork(options.style_features),
             embedding = OpenImageNetwork(options.style_embedding);
  if (features || embedding)
    targets->style_features =
        std::make_shared<const StyleFeatures>(features, embedding, *targets->style);
}

}  // namespace regrade
