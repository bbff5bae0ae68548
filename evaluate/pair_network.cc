#include "evaluate/pair_network.h"

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

struct PairNetwork::Implementation {
  std::string path;
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

  cv::Mat Run(const Image& first, const Image& second, bool as_given) const {
    if (!first.SameSize(second))
      Fail("two pictures differ in size", "use pictures of one size");
    const std::lock_guard lock(mutex);
    cv::Mat output;
    try {
      const QuietOpenCv quiet;
      net.setInput(BlobOf(first, as_given), "first");
      net.setInput(BlobOf(second, as_given), "second");
      output = net.forward().clone();
    } catch (const cv::Exception& exception) {
      Fail("the network does not run: " + exception.err,
           "it must have two inputs named first and second, [1, 3, height, width] from -1 to "
           "1, and take pictures of any size");
    }
    if (output.type() != CV_32F || !cv::checkRange(output))
      Fail("its output has non-finite values",
           "the weights may be damaged: copy the file again");
    return output;
  }
};

PairNetwork::PairNetwork(const std::string& path)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->path = path;
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

PairNetwork::~PairNetwork() = default;

FlowField PairNetwork::Flow(const Image& from, const Image& to) const {
  const cv::Mat output = implementation_->Run(from, to, false);
  if (output.dims != 4 || output.size[1] != 2 || output.size[2] != from.height ||
      output.size[3] != from.width)
    implementation_->Fail(Concat("its output is not a motion field of ", from.width, " x ",
                                 from.height, " pixels"),
                          "expected: [1, 2, height, width]");
  FlowField flow(from.width, from.height);
  for (int y = 0; y < from.height; ++y)
    for (int x = 0; x < from.width; ++x)
      for (int c = 0; c < 2; ++c) flow.at(x, y)[c] = output.ptr<float>(0, c, y)[x];
  return flow;
}

double PairNetwork::Distance(const Image& a, const Image& b, bool as_given) const {
  const cv::Mat output = implementation_->Run(a, b, as_given);
  double sum = 0;
  const float* values = output.ptr<float>();
  for (size_t i = 0; i < output.total(); ++i) sum += values[i];
  return sum / static_cast<double>(output.total());
}

std::function<double(const Image&, const Image&)> PerceptualDistance(const std::string& path,
                                                                     bool as_given) {
  if (path.empty()) return {};
  const auto network = std::make_shared<const PairNetwork>(path);
  return [network, as_given](const Image& a, const Image& b) {
    return network->Distance(a, b, as_given);
  };
}

}  // namespace regrade
