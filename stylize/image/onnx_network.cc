#include "stylize/image/onnx_network.h"

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
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

FeatureMap Copied(const cv::Mat& blob, const std::string& name, const std::string& path) {
  if (blob.dims != 4 || blob.size[0] != 1 || blob.type() != CV_32F || !blob.isContinuous())
    Fail("its output \"" + name + "\" is not one map of 32-bit numbers", path,
         "expected is [1, channels, height, width]");
  FeatureMap map(blob.size[1], blob.size[2], blob.size[3]);
  std::memcpy(map.values.data(), blob.ptr<float>(), map.values.size() * sizeof(float));
  if (!std::ranges::all_of(map.values, [](float v) { return std::isfinite(v); }))
    Fail("its output \"" + name + "\" has values that are not finite numbers", path,
         "the weights may be damaged: copy the file again");
  return map;
}

}  // namespace

struct OnnxNetwork::Implementation {
  std::string path;
  std::string bytes;
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

OnnxNetwork::OnnxNetwork(const std::string& path)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->path = path;
  implementation_->bytes = ReadBytes(path);
  implementation_->Load();
}

void OnnxNetwork::GiveBackMemory() const { implementation_->Load(); }

OnnxNetwork::~OnnxNetwork() = default;
OnnxNetwork::OnnxNetwork(OnnxNetwork&&) noexcept = default;

const std::string& OnnxNetwork::path() const { return implementation_->path; }

std::vector<FeatureMap> OnnxNetwork::Run(const std::vector<Input>& inputs,
                                         const std::vector<std::string>& outputs) const {
  const std::string& path = implementation_->path;
  cv::dnn::Net& net = implementation_->net;
  std::string wanted;
  for (const std::string& name : outputs) wanted += (wanted.empty() ? "" : ", ") + name;
  std::vector<cv::Mat> blobs;
  try {
    const QuietOpenCv quiet;
    cv::setNumThreads(omp_get_max_threads());  // what --threads says
    for (const auto& [name, map] : inputs) {
      const int shape[] = {1, map->channels, map->height, map->width};
      // dnn only reads its inputs, but its headers have no const view.
      net.setInput(cv::Mat(4, shape, CV_32F, const_cast<float*>(map->values.data())), name);
    }
    net.forward(blobs, std::vector<cv::String>(outputs.begin(), outputs.end()));
  } catch (const cv::Exception& exception) {
    Fail("the network does not run: " + Reason(exception), path,
         "it must have the outputs " + wanted + " and take pictures of any size");
  }
  REGRADE_CHECK_EQ(blobs.size(), outputs.size());
  std::vector<FeatureMap> maps;
  for (size_t i = 0; i < blobs.size(); ++i) maps.push_back(Copied(blobs[i], outputs[i], path));
  return maps;
}

}  // namespace regrade
