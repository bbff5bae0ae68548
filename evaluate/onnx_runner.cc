#include "evaluate/onnx_runner.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "kernels/base/error.h"

namespace regrade {
namespace {

// Suppresses OpenCV's own error output: the message is reported once, by Error.
class QuietOpenCv {
 public:
  QuietOpenCv()
      : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {
    cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  }
  ~QuietOpenCv() {
    cv::utils::logging::setLogLevel(level_);
    cv::redirectError(nullptr);
  }

 private:
  cv::utils::logging::LogLevel level_;
};

// [1, 3, height, width] from -1 to 1, or `as_given`; non-finite values become black.
cv::Mat BlobOf(const Image& image, bool as_given) {
  const int shape[] = {1, 3, image.height, image.width};
  cv::Mat blob(4, shape, CV_32F);
  for (int c = 0; c < 3; ++c)
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const float value = image.at(x, y)[image.channels >= 3 ? c : 0];
        const float shown = value > 0 ? std::min(value, 1.0f) : 0.0f;
        const float given = std::isfinite(value) ? value : 0.0f;
        blob.ptr<float>(0, c, y)[x] = as_given ? given : 2 * shown - 1;
      }
  return blob;
}

}  // namespace

struct OnnxRunner::Implementation {
  std::string path, expected;
  mutable std::mutex mutex;
  mutable cv::dnn::Net net;

  [[noreturn]] void Fail(const std::string& what, const std::string& hint) const {
    throw ProgramError(what, path, hint);
  }

  // Reads at most 1 GiB and parses from memory: the network cannot reference external files.
  std::string ReadBytes() const {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error))
      Fail("there is no such file", "name the network's ONNX file");
    const uintmax_t size = std::filesystem::file_size(path, error);
    if (error || size == 0 || size > 1u << 30)
      Fail("the file is empty, above 1 GiB, or cannot be read", "copy it again");
    std::string bytes(static_cast<size_t>(size), '\0');
    std::ifstream file(path, std::ios::binary);
    if (!file.read(bytes.data(), static_cast<std::streamsize>(size)))
      Fail("the file cannot be read", "check its permissions");
    return bytes;
  }

  NetworkOutput Copied(const cv::Mat& output) const {
    if (output.type() != CV_32F || !output.isContinuous() || !cv::checkRange(output))
      Fail("its output has non-finite values",
           "the weights may be damaged: copy the file again");
    NetworkOutput copied;
    for (int d = 0; d < output.dims; ++d) copied.shape.push_back(output.size[d]);
    copied.values.assign(output.ptr<float>(), output.ptr<float>() + output.total());
    return copied;
  }

  std::vector<NetworkOutput> Run(const Inputs& inputs, bool as_given, bool all) const {
    for (const auto& [name, picture] : inputs)
      if (!picture->SameSize(*inputs.front().second))
        Fail("two pictures differ in size", "use pictures of one size");
    const std::lock_guard lock(mutex);
    std::vector<cv::Mat> outputs(1);
    try {
      const QuietOpenCv quiet;
      for (const auto& [name, picture] : inputs) net.setInput(BlobOf(*picture, as_given), name);
      if (all)
        net.forward(outputs, net.getUnconnectedOutLayersNames());
      else
        outputs[0] = net.forward();
    } catch (const cv::Exception& exception) {
      Fail("the network does not run: " + exception.err, expected);
    }
    std::vector<NetworkOutput> copies;
    for (const cv::Mat& output : outputs) copies.push_back(Copied(output));
    return copies;
  }
};

OnnxRunner::OnnxRunner(const std::string& path, const std::string& expected)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->path = path;
  implementation_->expected = expected;
  const std::string bytes = implementation_->ReadBytes();
  try {
    const QuietOpenCv quiet;
    implementation_->net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
  } catch (const cv::Exception& exception) {
    implementation_->Fail(
        "it is not an ONNX file, or not one that OpenCV can run: " + exception.err,
        "convert the network to ONNX of opset 11 with 32-bit numbers");
  }
  implementation_->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
  implementation_->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
}

OnnxRunner::~OnnxRunner() = default;

NetworkOutput OnnxRunner::Run(const Inputs& inputs, bool as_given) const {
  return std::move(implementation_->Run(inputs, as_given, /*all=*/false).front());
}

std::vector<NetworkOutput> OnnxRunner::RunAll(const Inputs& inputs) const {
  return implementation_->Run(inputs, /*as_given=*/false, /*all=*/true);
}

void OnnxRunner::Refuse(const std::string& what, const std::string& hint) const {
  implementation_->Fail(what, hint);
}

}  // namespace regrade
