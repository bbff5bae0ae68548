// Networks that draw edge maps.
#pragma once

#include <string>

#include "evaluate/edge_map.h"
#include "evaluate/onnx_runner.h"
#include "kernels/scene/image.h"

namespace regrade {

// An ONNX file with one input of any name, [1, 3, height, width], RGB from -1 to 1. Errors:
// those of OnnxRunner, and an output of another shape.
class EdgeNetwork {
 public:
  explicit EdgeNetwork(const std::string& path);

  // One channel of the picture's size, as the output [1, 1, height, width] has it.
  Image EdgeMap(const Image& picture) const;

 private:
  OnnxRunner runner_;
};

// "gradient" or the ONNX file of an edge network, see EdgeNetwork::EdgeMap; empty for an empty
// text. Errors: those of EdgeNetwork.
EdgeMapFunction EdgeMaps(const std::string& edges);

}  // namespace regrade
