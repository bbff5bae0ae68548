// A network with two input images, for optical flow or a perceptual distance. OpenCV's dnn
// module runs it.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

// An ONNX file with two inputs named "first" and "second", [1, 3, height, width] RGB from -1 to
// 1, as written by torch.onnx.export(..., input_names=["first", "second"]), and one output.
// Calls are serialised. Errors (kExternalProgram, naming the file): no file, not ONNX, an
// operator that OpenCV lacks, other inputs, non-finite outputs.
class PairNetwork {
 public:
  explicit PairNetwork(const std::string& path);
  ~PairNetwork();

  // The motion from `from` to `to` in pixels: the output is [1, 2, height, width], x before y,
  // as RAFT's.
  FlowField Flow(const Image& from, const Image& to) const;

  // The mean of the output, of any shape: LPIPS (Zhang et al. 2018) returns one number. With
  // `as_given` the network gets the pictures' values as they are, in any range.
  double Distance(const Image& a, const Image& b, bool as_given = false) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

// PairNetwork::Distance by the network in the file; empty for an empty path.
std::function<double(const Image&, const Image&)> PerceptualDistance(const std::string& path,
                                                                     bool as_given = false);

}  // namespace regrade
