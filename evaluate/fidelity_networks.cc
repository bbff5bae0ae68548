#include "evaluate/fidelity_networks.h"

#include "evaluate/edge_network.h"
#include "evaluate/pair_network.h"

namespace regrade {

void OpenNetworks(const ConsistencyOptions& options, FidelityTargets* targets) {
  targets->perceptual = PerceptualDistance(options.lpips);
  targets->edges = EdgeMaps(options.edges);
}

}  // namespace regrade
