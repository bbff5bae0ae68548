#include "evaluate/fidelity_networks.h"

#include <utility>

#include "evaluate/image_network.h"
#include "evaluate/pair_network.h"

namespace regrade {

void OpenNetworks(const ConsistencyOptions& options, FidelityTargets* targets) {
  targets->perceptual = PerceptualDistance(options.lpips);
  targets->edges = EdgeMaps(options.edges);
  if (targets->style == nullptr) return;
  const auto features = OpenImageNetwork(options.style_features),
             embedding = OpenImageNetwork(options.style_embedding);
  if (!features && !embedding) return;
  FeaturesFunction features_of;
  EmbeddingFunction embedding_of;
  if (features) features_of = [features](const Image& p) { return features->Features(p); };
  if (embedding) embedding_of = [embedding](const Image& p) { return embedding->Embedding(p); };
  targets->style_features = std::make_shared<const StyleFeatures>(
      std::move(features_of), std::move(embedding_of), *targets->style);
}

}  // namespace regrade
