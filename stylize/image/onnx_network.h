// A convolutional network from an ONNX file, run on the CPU.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stylize/image/feature_map.h"

namespace regrade {

// Runs in one thread at a time. All errors are Error(kExternalProgram) that name the file.
class OnnxNetwork {
 public:
  // Files above 1 GiB, files that are not ONNX, and operators that OpenCV's dnn module does not
  // know are refused.
  explicit OnnxNetwork(const std::string& path);
  ~OnnxNetwork();
  OnnxNetwork(OnnxNetwork&&) noexcept;

  using Input = std::pair<std::string, const FeatureMap*>;
  // The named outputs, in the order asked for. A name that the file lacks, an output that is
  // not [1, channels, height, width], or one with a value that is not finite is an error. Sizes
  // may change from call to call.
  std::vector<FeatureMap> Run(const std::vector<Input>& inputs,
                              const std::vector<std::string>& outputs) const;
  // Gives back the memory that Run keeps for pictures of the sizes it has seen, which is
  // several times what comes out; costs reading the network anew, from memory.
  void GiveBackMemory() const;
  const std::string& path() const;

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace regrade
