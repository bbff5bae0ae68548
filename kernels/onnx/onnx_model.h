// A network from an ONNX file, run on the CPU by OpenCV's dnn module.
#pragma once

#include <memory>
#include <string>
#include <vector>

namespace regrade {

struct OnnxArray {
  std::vector<int> shape;
  std::vector<float> values;  // row-major, all finite
};

// Calls are serialised. Errors are Error(kExternalProgram) that name the file.
class OnnxModel {
 public:
  // Errors: no file, one that is empty or above 1 GiB, not ONNX, an operator that OpenCV lacks.
  // It is parsed from memory, so it cannot refer to other files.
  explicit OnnxModel(const std::string& path);
  ~OnnxModel();
  OnnxModel(OnnxModel&&) noexcept;

  struct Input {
    std::string name;  // empty: the network's first
    std::vector<int> shape;
    const float* values;
  };
  // The named outputs, in the order asked for; without names that of the last operator. Sizes
  // may change from call to call. Errors: an output that the file lacks, inputs that it does
  // not take, for which `expected` says what it should take, and outputs that are not finite
  // 32-bit numbers.
  std::vector<OnnxArray> Run(const std::vector<Input>& inputs,
                             const std::vector<std::string>& outputs,
                             const std::string& expected) const;

  // Gives back the memory that Run keeps for the sizes it has seen, which is several times what
  // comes out; costs reading the network anew, from memory.
  void GiveBackMemory() const;
  const std::string& path() const;

  // Throws the error of a file that is not what its user expects.
  [[noreturn]] void Refuse(const std::string& what, const std::string& hint) const;

  // How many threads run the networks of this process.
  static void UseThreads(int threads);

 private:
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace regrade
