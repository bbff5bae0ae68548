// Pictures as inputs of the evaluation's networks.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "kernels/onnx/onnx_model.h"
#include "kernels/scene/image.h"

namespace regrade {

// Errors (kExternalProgram, naming the file): those of OnnxModel, and pictures that differ in
// size.
class OnnxRunner {
 public:
  // `expected` says in an error what the network has to take.
  OnnxRunner(const std::string& path, const std::string& expected)
      : model_(path), expected_(expected) {}

  // Inputs are [1, 3, height, width], RGB from -1 to 1, values that are not finite black;
  // `as_given` leaves other values as the picture has them. An input without a name is the
  // network's first.
  using Inputs = std::vector<std::pair<std::string, const Image*>>;
  OnnxArray Run(const Inputs& inputs, bool as_given = false) const;

  [[noreturn]] void Refuse(const std::string& what, const std::string& hint) const {
    model_.Refuse(what, hint);
  }

 private:
  OnnxModel model_;
  std::string expected_;
};

}  // namespace regrade
