#include "evaluate/edge_network.h"

#include <memory>
#include <utility>
#include <vector>

#include "kernels/base/error.h"

namespace regrade {

EdgeNetwork::EdgeNetwork(const std::string& path)
    : runner_(
          path,
          "it must have one input, [1, 3, height, width] from -1 to 1, and take pictures of "
          "any size") {}

Image EdgeNetwork::EdgeMap(const Image& picture) const {
  OnnxArray output = runner_.Run({{"", &picture}});
  if (output.shape != std::vector<int>{1, 1, picture.height, picture.width})
    runner_.Refuse(Concat("its output is not an edge map of ", picture.width, " x ",
                          picture.height, " pixels"),
                   "expected: [1, 1, height, width] from 0 to 1");
  Image map(picture.width, picture.height, 1);
  map.pixels = std::move(output.values);
  return map;
}

EdgeMapFunction EdgeMaps(const std::string& edges) {
  if (edges.empty()) return {};
  if (edges == kGradientEdges) return GradientEdges;
  return [network = std::make_shared<const EdgeNetwork>(edges)](const Image& picture) {
    return network->EdgeMap(picture);
  };
}

}  // namespace regrade
