// Runs the ONNX files of the evaluation's networks with OpenCV's dnn module.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "kernels/scene/image.h"

namespace regrade {

struct NetworkOutput {
  std::vector<int> shape;
  std::vector<float> values;  // all finite
};

// Calls are serialised. Errors (kExternalProgram, naming the file): no file, one that is empty
// or above 1 GiB, not ONNX, an operator that OpenCV lacks, other inputs, outputs that are not
// finite 32-bit numbers.
class OnnxRunner {
 public:
  // `expected` says in an error what the network has to take.
  OnnxRunner(const std::string& path, const std::string& expected);
  ~OnnxRunner();

  // Inputs are [1, 3, height, width], RGB from -1 to 1, values that are not finite black;
  // `as_given` leaves other values as the picture has them. An input without a name is the
  // network's first.
  using Inputs = std::vector<std::pair<std::string, const Image*>>;
  NetworkOutput Run(const Inputs& inputs, bool as_given = false) const;
  // Every output that feeds no other operator, in the order of the file.
  std::vector<NetworkOutput> RunAll(const Inputs& inputs) const;

  [[noreturn]] void Refuse(const std::string& what, const std::string& hint) const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace regrade
