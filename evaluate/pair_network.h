// A network that is given two pictures: optical flow, or a distance as people see it. OpenCV's
// dnn module runs it.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "evaluate/flow_field.h"
#include "kernels/scene/image.h"

namespace regrade {

// An ONNX file with two inputs named "first" and "second", [1, 3, height, width] RGB from -1 to
// 1, as torch.onnx.export(..., input_names=["first", "second"]) writes it, and one output. Runs
// in one thread at a time. Errors are Error(kExternalProgram) that name the file: no file, not
// ONNX, an operator that OpenCV lacks, other inputs, values that are not finite.
class PairNetwork {
 public:
  explicit PairNetwork(const std::string& path);
  ~PairNetwork();

  // The motion from `from` to `to` in pixels: the output is [1, 2, height, width], x before y,
  // as RAFT's is.
  FlowField Flow(const Image& from, const Image& to) const;

  // The mean of the output, of whatever shape: LPIPS (Zhang et al. 2018) gives one number.
  double Distance(const Image& a, const Image& b) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

// How different two pictures look, by the network in that file; empty for no file.
std::function<double(const Image&, const Image&)> PerceptualDistance(const std::string& path);

}  // namespace regrade
