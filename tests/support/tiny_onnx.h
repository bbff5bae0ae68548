// ONNX files of two or three operators, for tests of code that runs networks.
#pragma once

#include "stylize/image/onnx_writer.h"

namespace regrade::testing {

using TinyOnnx = OnnxWriter;

// The mean squared difference of both pictures in the network's range [-1, 1]: 4 times that
// of pictures in [0, 1].
inline std::string DistanceNetwork(int height, int width) {
  TinyOnnx network(height, width);
  network.Node("Sub", {"first", "second"}, "difference");
  network.Node("Mul", {"difference", "difference"}, "square");
  network.Node("GlobalAveragePool", {"square"}, "distance");
  return network.Bytes({1, 3, 1, 1});
}

// The motion u = 10 + 3 (red of the second - red of the first) / 2, v = -0.5.
inline std::string FlowNetwork(int height, int width) {
  TinyOnnx network(height, width);
  std::vector<float> weights(12);
  weights[0] = -0.75f * 2;
  weights[3] = 0.75f * 2;
  network.Weights("weights", {2, 6, 1, 1}, weights);
  network.Weights("bias", {2}, {10, -0.5f});
  network.Node("Concat", {"first", "second"}, "both", TinyOnnx::Integer("axis", 1));
  network.Node("Conv", {"both", "weights", "bias"}, "flow",
               TinyOnnx::Integers("kernel_shape", {1, 1}));
  return network.Bytes({1, 2, height, width});
}

}  // namespace regrade::testing
