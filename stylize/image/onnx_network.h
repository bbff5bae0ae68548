// A convolutional network from an ONNX file, from maps of features to maps of features.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "kernels/onnx/onnx_model.h"
#include "stylize/image/feature_map.h"

namespace regrade {

// All errors are Error(kExternalProgram) that name the file, see OnnxModel.
class OnnxNetwork {
 public:
  explicit OnnxNetwork(const std::string& path) : model_(path) {}

  using Input = std::pair<std::string, const FeatureMap*>;
  // The named outputs, in the order asked for; one that is not [1, channels, height, width] is
  // an error. Sizes may change from call to call. Runs in as many threads as OpenMP has.
  std::vector<FeatureMap> Run(const std::vector<Input>& inputs,
                              const std::vector<std::string>& outputs) const;
  void GiveBackMemory() const { model_.GiveBackMemory(); }  // see OnnxModel
  const std::string& path() const { return model_.path(); }

 private:
  OnnxModel model_;
};

}  // namespace regrade
