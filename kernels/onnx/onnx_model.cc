#include "kernels/onnx/onnx_model.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "kernels/base/error.h"

namespace regrade {
namespace {

constexpr uintmax_t kMostBytes = 1u << 30;

// OpenCV prints what it throws; a person shall read it once, in our message.
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

[[noreturn]] void Fail(const std::string& what, const std::string& path,
                       const std::string& hint) {
  throw ProgramError(what, path, hint);
}

// The first line of what OpenCV says, without its place in OpenCV.
std::string Reason(const cv::Exception& exception) {
  const std::string text = exception.err.empty() ? exception.what() : exception.err;
  return text.substr(0, std::min<size_t>(text.find('\n'), 200));
}

std::string ReadBytes(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
    Fail("there is no such file", path, "name a file or folder that holds the networks");
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error || size == 0) Fail("the file is empty or cannot be read", path, "copy it again");
  if (size > kMostBytes)
    Fail(Concat("the file has ", size, " bytes"), path, "at most 1 GiB is read");
  std::string bytes(static_cast<size_t>(size), '\0');
  std::ifstream file(path, std::ios::binary);
  if (!file.read(bytes.data(), static_cast<std::streamsize>(size)))
    Fail("the file cannot be read", path, "look at its permissions");
  return bytes;
}

OnnxArray Copied(const cv::Mat& blob, const std::string& name, const std::string& path) {
  const std::string output = name.empty() ? "its output" : "its output \"" + name + "\"";
  if (blob.type() != CV_32F || !blob.isContinuous())
    Fail(output + " has no 32-bit numbers", path,
         "convert the network to ONNX of opset 11 with 32-bit numbers");
  OnnxArray array;
  for (int d = 0; d < blob.dims; ++d) array.shape.push_back(blob.size[d]);
  array.values.assign(blob.ptr<float>(), blob.ptr<float>() + blob.total());
  if (!std::ranges::all_of(array.values, [](float v) { return std::isfinite(v); }))
    Fail(output + " has values that are not finite numbers", path,
         "the weights may be damaged: copy the file again");
  return array;
}

}  // namespace

struct OnnxModel::Implementation {
  std::string path, bytes;
  std::mutex mutex;
  cv::dnn::Net net;

  void Load() {
    const char* hint = "convert the network to ONNX of opset 11 with 32-bit numbers";
    try {
      const QuietOpenCv quiet;
      net = cv::dnn::readNetFromONNX(bytes.data(), bytes.size());
    } catch (const cv::Exception& exception) {
      Fail("it is not an ONNX file, or not one that OpenCV can run: " + Reason(exception), path,
           hint);
    }
    if (net.empty()) Fail("it holds no network", path, hint);
    net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
  }
};

OnnxModel::OnnxModel(const std::string& path)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->path = path;
  implementation_->bytes = ReadBytes(path);
  implementation_->Load();
}

OnnxModel::~OnnxModel() = default;
OnnxModel::OnnxModel(OnnxModel&&) noexcept = default;

std::vector<OnnxArray> OnnxModel::Run(const std::vector<Input>& inputs,
                                      const std::vector<std::string>& outputs,
                                      const std::string& expected) const {
  const std::lock_guard lock(implementation_->mutex);
  cv::dnn::Net& net = implementation_->net;
  std::vector<cv::Mat> blobs(1);
  try {
    const QuietOpenCv quiet;
    for (const Input& input : inputs)
      // dnn only reads its inputs, but its headers have no const view.
      net.setInput(cv::Mat(static_cast<int>(input.shape.size()), input.shape.data(), CV_32F,
                           const_cast<float*>(input.values)),
                   input.name);
    if (outputs.empty())
      blobs[0] = net.forward();
    else
      net.forward(blobs, std::vector<cv::String>(outputs.begin(), outputs.end()));
  } catch (const cv::Exception& exception) {
    Fail("the network does not run: " + Reason(exception), path(), expected);
  }
  REGRADE_CHECK(outputs.empty() || blobs.size() == outputs.size());
  std::vector<OnnxArray> arrays;
  for (size_t i = 0; i < blobs.size(); ++i)
    arrays.push_back(Copied(blobs[i], outputs.empty() ? "" : outputs[i], path()));
  return arrays;
}

void OnnxModel::GiveBackMemory() const {
  const std::lock_guard lock(implementation_->mutex);
  implementation_->Load();
}

const std::string& OnnxModel::path() const { return implementation_->path; }

void OnnxModel::Refuse(const std::string& what, const std::string& hint) const {
  Fail(what, path(), hint);
}

void OnnxModel::UseThreads(int threads) { cv::setNumThreads(threads); }

}  // namespace regrade
