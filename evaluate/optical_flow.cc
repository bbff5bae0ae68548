#include "evaluate/optical_flow.h"

#include <cstring>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "kernels/base/error.h"
#if defined(REGRADE_OPTFLOW)
#include "evaluate/flow_module.h"
#include "kernels/process/program_module.h"
#endif

namespace regrade {
namespace {

std::string SizeText(const Image& image) {
  return Concat(image.width, " x ", image.height, " px");
}

uint8_t ToByte(float value) {
  // The comparison is false for NaN, which becomes black.
  if (!(value > 0)) return 0;
  return value < 1 ? static_cast<uint8_t>(value * 255.0f + 0.5f) : 255;
}

cv::Mat Bytes(const Image& image, bool in_colour) {
  const bool colour = image.channels >= 3;
  cv::Mat bytes(image.height, image.width, colour ? CV_8UC3 : CV_8UC1);
  const int kept = colour ? 3 : 1;
  for (int y = 0; y < image.height; ++y) {
    uint8_t* row = bytes.ptr<uint8_t>(y);
    const float* pixels = image.at(0, y);
    if (kept == image.channels) {
      for (int i = 0; i < image.width * kept; ++i) row[i] = ToByte(pixels[i]);
    } else {
      for (int x = 0; x < image.width; ++x)
        for (int c = 0; c < kept; ++c)
          row[x * kept + c] = ToByte(pixels[x * image.channels + c]);
    }
  }
  cv::Mat result = bytes;
  if (colour && !in_colour) cv::cvtColor(bytes, result, cv::COLOR_RGB2GRAY);
  if (!colour && in_colour) cv::cvtColor(bytes, result, cv::COLOR_GRAY2RGB);
  return result;
}

bool Contributed(const std::string& name) {
  return name == "deepflow" || name == "tvl1" || name == "pca-flow" || name == "rlof";
}

cv::Ptr<cv::DenseOpticalFlow> MakeContributed([[maybe_unused]] const std::string& name) {
#if defined(REGRADE_OPTFLOW)
  cv::Ptr<cv::DenseOpticalFlow> method;
  reinterpret_cast<decltype(&RegradeContributedFlow)>(
      ModuleFunction("flow", "RegradeContributedFlow"))(name, &method);
  return method;
#else
  throw UsageError(
      "this build has no optical flow '" + name + "'", "--flow",
      "install the package libopencv-contrib-dev and build again, or choose one of " +
          std::string(kFlowMethods));
#endif
}

cv::Ptr<cv::DenseOpticalFlow> MakeMethod(const std::string& name) {
  using cv::DISOpticalFlow;
  if (name == "dis-ultrafast") return DISOpticalFlow::create(DISOpticalFlow::PRESET_ULTRAFAST);
  if (name == "dis-fast") return DISOpticalFlow::create(DISOpticalFlow::PRESET_FAST);
  if (name == "dis-medium") return DISOpticalFlow::create(DISOpticalFlow::PRESET_MEDIUM);
  if (name == "dis-tuned") {
    auto dis = DISOpticalFlow::create(DISOpticalFlow::PRESET_MEDIUM);
    dis->setFinestScale(0);
    dis->setPatchStride(3);
    dis->setVariationalRefinementIterations(10);
    dis->setUseSpatialPropagation(true);
    return dis;
  }
  if (Contributed(name)) return MakeContributed(name);
  if (name == "farneback") return cv::FarnebackOpticalFlow::create(5, 0.5, false, 15);
  throw UsageError("unknown optical flow method", name,
                   std::string("choose one of ") + kFlowMethods + "|" +
                       kContributedFlowMethods + ", files:DIR or onnx:FILE");
}

}  // namespace

FlowField ComputeFlow(const Image& from, const Image& to, const std::string& method) {
  const cv::Ptr<cv::DenseOpticalFlow> algorithm = MakeMethod(method);
  if (!from.SameSize(to))
    throw InputError("frames differ in size: " + SizeText(from) + " and " + SizeText(to), "",
                     "all frames of a sequence must have one size");
  if (from.width < kLeastFlowSide || from.height < kLeastFlowSide)
    throw InputError("frames of " + SizeText(from) + " are too small for flow", "",
                     "use frames of at least 12 x 12 px");
  cv::Mat flow;
  const bool in_colour = method == "rlof";  // the only method that needs colour
  algorithm->calc(Bytes(from, in_colour), Bytes(to, in_colour), flow);
  REGRADE_CHECK_EQ(flow.cols, from.width);
  REGRADE_CHECK_EQ(flow.rows, from.height);
  FlowField result(from.width, from.height);
  for (int y = 0; y < flow.rows; ++y)
    std::memcpy(result.at(0, y), flow.ptr<float>(y), sizeof(float) * 2 * flow.cols);
  return result;
}

}  // namespace regrade
