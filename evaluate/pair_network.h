// A network with two input images, for optical flow or a perceptual distance.
#pragma once

#include <functional>
#include <string>

#include "evaluate/flow_field.h"
#include "evaluate/onnx_runner.h"
#include "kernels/scene/image.h"

namespace regrade {

// An ONNX file with two inputs named "first" and "second", [1, 3, height, width] RGB from -1 to
// 1, as written by torch.onnx.export(..., input_names=["first", "second"]), and one output.
// Errors: those of OnnxRunner.
class PairNetwork {
 public:
  explicit PairNetwork(const std::string& path);

  // The motion from `from` to `to` in pixels: the output is [1, 2, height, width], x before y,
  // as RAFT's.
  FlowField Flow(const Image& from, const Image& to) const;

  // The mean of the output, of any shape: LPIPS (Zhang et al. 2018) returns one number. With
  // `as_given` the network gets the pictures' values as they are, in any range.
  double Distance(const Image& a, const Image& b, bool as_given = false) const;

 private:
  OnnxRunner runner_;
};

// PairNetwork::Distance by the network in the file; empty for an empty path.
std::function<double(const Image&, const Image&)> PerceptualDistance(const std::string& path,
                                                                     bool as_given = false);

}  // namespace regrade
