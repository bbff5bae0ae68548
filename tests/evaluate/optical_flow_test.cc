#include "evaluate/optical_flow.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <opencv2/core/utility.hpp>

#include "evaluate/flow_file.h"
#include "kernels/base/error.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using namespace regrade::testing;

Image ReadPpm(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string magic;
  int width = 0, height = 0, white = 0;
  file >> magic >> width >> height >> white;
  file.get();
  EXPECT_EQ(magic, "P6");
  EXPECT_EQ(white, 255);
  std::vector<unsigned char> bytes(static_cast<size_t>(width) * height * 3);
  file.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
  EXPECT_TRUE(file);
  Image image(width, height, 3);
  for (size_t i = 0; i < bytes.size(); ++i) image.pixels[i] = bytes[i] / 255.0f;
  return image;
}

double MeanEndPointError(const FlowField& flow, const FlowField& truth) {
  double sum = 0;
  int64_t count = 0;
  for (size_t i = 0; i < truth.uv.size(); i += 2) {
    if (!std::isfinite(truth.uv[i])) continue;
    sum += std::hypot(flow.uv[i] - truth.uv[i], flow.uv[i + 1] - truth.uv[i + 1]);
    ++count;
  }
  return sum / count;
}

TEST(OpticalFlow, FollowsAKnownShift) {
  const Image from = WaveImage(96, 80, 0, 0), to = WaveImage(96, 80, 2.5, -1.25);
  for (const std::string method :
       {"dis-ultrafast", "dis-fast", "dis-medium", "dis-tuned", "farneback"}) {
    const FlowField flow = ComputeFlow(from, to, method);
    double worst = 0;
    for (int y = 20; y < 60; ++y)
      for (int x = 20; x < 76; ++x)
        worst = std::max(worst, std::hypot(flow.at(x, y)[0] - 2.5, flow.at(x, y)[1] + 1.25));
    // A third of a pixel: a method that does not follow at all is off by 2.8 px.
    EXPECT_LT(worst, 0.34) << method;
  }
}

TEST(OpticalFlow, H122_SmallMismatchedOrUnknownIsAClearError) {
  const Image small = WaveImage(11, 40, 0, 0), good = WaveImage(13, 17, 0, 0);
  EXPECT_REGRADE_ERROR(ComputeFlow(small, small, "dis-medium"), ExitCode::kInput);
  EXPECT_REGRADE_ERROR(ComputeFlow(small, good, "dis-medium"), ExitCode::kInput);
  EXPECT_REGRADE_ERROR(ComputeFlow(good, good, "raft"), ExitCode::kUsage);
}

TEST(OpticalFlow, H122_OddSizesGreyAndAlphaWork) {
  for (const char* method : {"dis-medium", "farneback"}) {
    const FlowField flow = ComputeFlow(NoiseImage(13, 17, 1), NoiseImage(13, 17, 1), method);
    EXPECT_EQ(flow.width, 13);
    EXPECT_EQ(flow.height, 17);
    for (const float v : flow.uv) EXPECT_NEAR(v, 0, 0.05);
  }
  EXPECT_EQ(ComputeFlow(NoiseImage(12, 12, 1, 1), NoiseImage(12, 12, 2, 1), "dis-fast").width,
            12);
  EXPECT_EQ(ComputeFlow(NoiseImage(12, 12, 1, 4), NoiseImage(12, 12, 2, 4), "dis-fast").width,
            12);
}

TEST(OpticalFlow, H116_ColoursThatAreNotFiniteGiveFiniteFlow) {
  Image from = WaveImage(64, 64, 0, 0);
  from.at(30, 30)[1] = kNan;
  from.at(31, 30)[0] = std::numeric_limits<float>::infinity();
  for (const float v : ComputeFlow(from, WaveImage(64, 64, 1, 0), "dis-medium").uv)
    EXPECT_TRUE(std::isfinite(v));
}

TEST(OpticalFlow, SameForAnyNumberOfThreads) {
  const Image from = WaveImage(160, 120, 0, 0), to = WaveImage(160, 120, 3, 2);
  const int threads = cv::getNumThreads();
  for (const char* method : {"dis-medium", "dis-tuned", "farneback"}) {
    cv::setNumThreads(1);
    const FlowField one = ComputeFlow(from, to, method);
    cv::setNumThreads(2);
    EXPECT_EQ(one.uv, ComputeFlow(from, to, method).uv) << method;
  }
  cv::setNumThreads(threads);
}

// Bounds are a fifth above the measured errors (no motion at all: 4.31, 2.11, 4.77 px); a swap
// of u and v or of the frames is off by pixels.
TEST(OpticalFlow, EndPointErrorOnPublishedTruth) {
  REGRADE_NEED_DATA("flow_truth/00001_flow.flo");
  struct Bound {
    const char* method;
    double epe[3];
  };
  const Bound bounds[] = {{"dis-medium", {3.35, 0.77, 3.62}},
                          {"dis-tuned", {2.53, 0.77, 3.01}}};
  for (const Bound& bound : bounds)
    for (int i = 0; i < 3; ++i) {
      const std::string stem = DataPath("flow_truth/0000" + std::to_string(i + 1));
      const FlowField truth = ReadFlowFile(stem + "_flow.flo");
      const double epe = MeanEndPointError(
          ComputeFlow(ReadPpm(stem + "_img1.ppm"), ReadPpm(stem + "_img2.ppm"), bound.method),
          truth);
      RecordProperty(std::string(bound.method) + std::to_string(i + 1), std::to_string(epe));
      EXPECT_LT(epe, bound.epe[i]) << bound.method << ", pair " << i + 1;
    }
}

}  // namespace
}  // namespace regrade
