// CCPL's transform, by tiny networks whose result is computed here in double.
#include "stylize/image/ccpl_stylizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "stylize/image/network_pictures.h"
#include "stylize/image/onnx_stylizer.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_onnx.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

using testing::kDay;
using testing::kEvening;
using testing::LargestDifference;
using testing::TinyOnnx;
using testing::WavyPicture;

// The networks: the largest of 2 x 2 pixels of each colour, into a code of two numbers and out
// again, and four equal pixels for each.
using Weights = std::vector<double>;
const Weights kContent{0.7, 0.2, -0.4, 0.1, -0.6, 0.5};  // 3 -> 2
const Weights kStyle{1.5, -0.5, 0.8, 0.3, 1.2, -0.9};    // 3 -> 2, the middle of 3 x 3
const Weights kStyleBias{0.4, -0.3};                     // so that the code's mean is not 0
const Weights kExpand{0.5, -0.2, 0.1, 0.4, -0.3, 0.6};   // 2 -> 3
const Weights kExpandBias{0.05, -0.04, 0.03};
constexpr double kShade = 0.9;  // the decoder's, of what it is given

std::vector<float> Floats(const Weights& weights) { return {weights.begin(), weights.end()}; }

std::string OneConv(const std::string& from, int inputs, const std::string& to, int outputs,
                    int side, const std::vector<float>& weights, const Weights& bias) {
  TinyOnnx network;
  network.Input(from, inputs);
  network.Weights("weights", {outputs, inputs, side, side}, weights);
  network.Weights("bias", {outputs}, Floats(bias));
  network.Node("Conv", {from, "weights", "bias"}, to,
               TinyOnnx::Integers("kernel_shape", {side, side}));
  network.Output(to, outputs);
  return network.Bytes();
}

std::string Encoder() {
  TinyOnnx network;
  network.Input("image", 3);
  network.Node("MaxPool", {"image"}, "feat",
               TinyOnnx::Integers("kernel_shape", {2, 2}) +
                   TinyOnnx::Integers("strides", {2, 2}) + TinyOnnx::Integer("ceil_mode", 1));
  network.Output("feat", 3);
  return network.Bytes();
}

std::string Decoder() {
  TinyOnnx network;
  network.Input("feat", 3);
  network.Weights("weights", {3, 1, 2, 2}, std::vector<float>(12, kShade));
  network.Node("ConvTranspose", {"feat", "weights"}, "image",
               TinyOnnx::Integers("kernel_shape", {2, 2}) +
                   TinyOnnx::Integers("strides", {2, 2}) + TinyOnnx::Integer("group", 3));
  network.Output("image", 3);
  return network.Bytes();
}

std::string Style() {
  std::vector<float> weights;
  for (const double middle : kStyle)
    for (int i = 0; i < 9; ++i) weights.push_back(i == 4 ? static_cast<float>(middle) : 0);
  return OneConv("feat", 3, "code", 2, 3, weights, kStyleBias);
}

void WriteNetworks(const std::string& folder) {
  const auto write = [&](const char* name, const std::string& bytes) {
    testing::WriteText(folder + "/ccpl_" + name + ".onnx", bytes);
  };
  write("encoder", Encoder());
  write("content", OneConv("feat", 3, "code", 2, 1, Floats(kContent), {0, 0}));
  write("style", Style());
  write("expand", OneConv("code", 2, "feat", 3, 1, Floats(kExpand), kExpandBias));
  write("decoder", Decoder());
}

struct Features {
  int height, width;
  std::vector<std::array<double, 3>> values;
};

// What the encoder makes, of a picture of any size.
Features Halved(const Image& image) {
  Features features{(image.height + 1) / 2, (image.width + 1) / 2, {}};
  for (int y = 0; y < features.height; ++y)
    for (int x = 0; x < features.width; ++x) {
      std::array<double, 3> most{};
      for (int k = 0; k < 4; ++k) {
        const int u = 2 * x + k % 2, v = 2 * y + k / 2;
        if (u < image.width && v < image.height)
          for (size_t c = 0; c < 3; ++c) most[c] = std::max<double>(most[c], image.at(u, v)[c]);
      }
      features.values.push_back(most);
    }
  return features;
}

std::array<double, 3> MeanOf(const Features& features) {
  std::array<double, 3> mean{};
  for (const auto& v : features.values)
    for (size_t c = 0; c < 3; ++c)
      mean[c] += v[c] / static_cast<double>(features.values.size());
  return mean;
}

// EQ(simple-covariance), pixel by pixel.
Image Expected(const Image& photo, const Image& style) {
  const Features content = Halved(photo), styles = Halved(style);
  const auto mean = MeanOf(content), style_mean = MeanOf(styles);
  std::array<double, 3> spread{};
  for (size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (const auto& v : content.values) sum += (v[c] - mean[c]) * (v[c] - mean[c]);
    spread[c] = std::sqrt(sum / static_cast<double>(content.values.size() - 1) + 1e-5);
  }
  double moments[2][2] = {};
  int count = 0;
  for (int y = 1; y + 1 < styles.height; ++y)
    for (int x = 1; x + 1 < styles.width; ++x, ++count) {
      const auto& v = styles.values[static_cast<size_t>(y * styles.width + x)];
      double code[2] = {kStyleBias[0], kStyleBias[1]};
      for (size_t k = 0; k < 2; ++k)
        for (size_t c = 0; c < 3; ++c) code[k] += kStyle[3 * k + c] * (v[c] - style_mean[c]);
      for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) moments[i][j] += code[i] * code[j];
    }
  Image image(photo.width, photo.height);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const auto& v = content.values[static_cast<size_t>(y / 2 * content.width + x / 2)];
      double code[2] = {};
      for (size_t k = 0; k < 2; ++k)
        for (size_t c = 0; c < 3; ++c)
          code[k] += kContent[3 * k + c] * (v[c] - mean[c]) / spread[c];
      for (size_t c = 0; c < 3; ++c) {
        double value = kExpandBias[c] + style_mean[c];
        for (size_t i = 0; i < 2; ++i)
          value +=
              kExpand[2 * c + i] * (moments[i][0] * code[0] + moments[i][1] * code[1]) / count;
        image.at(x, y)[c] = static_cast<float>(std::clamp(kShade * value, 0.0, 1.0));
      }
    }
  return image;
}

class CcplStylizer : public ::testing::Test {
 protected:
  void SetUp() override { WriteNetworks(folder_.path()); }
  std::unique_ptr<ViewStylizer> Make(const Image& style, int max_side = 1024) const {
    return MakeOnnxStylizer(folder_.path(), max_side, style);
  }
  testing::TemporaryFolder folder_;
};

TEST_F(CcplStylizer, FeaturesMeetTheStylesSecondMoments) {
  const Image style = WavyPicture(56, 44, kEvening);
  const auto stylizer = Make(style);
  EXPECT_EQ(stylizer->Name(), "ccpl");
  // The second size is odd: the networks' picture is a row and a column too large.
  for (const auto& [width, height] : {std::pair{64, 48}, std::pair{61, 45}}) {
    const Image photo = WavyPicture(width, height, kDay);
    const Image expected = Expected(photo, style);
    EXPECT_LE(LargestDifference(stylizer->Stylize(photo, 0), expected), 1e-5);
    // Neither the photo nor the style alone comes near it: the moments do the work.
    EXPECT_GE(LargestDifference(photo, expected), 0.2);
    EXPECT_GE(LargestDifference(Expected(photo, WavyPicture(56, 44, kDay)), expected), 0.05);
  }
}

TEST_F(CcplStylizer, H27_AnySizeComesBackAsItWent) {
  const auto stylizer = Make(WavyPicture(8, 8, kEvening), 64);
  testing::ExpectAnySizeComesBack(*stylizer);
}

TEST_F(CcplStylizer, H7_OneColourOnEitherSideStaysFinite) {
  Image grey(48, 48);
  std::fill(grey.pixels.begin(), grey.pixels.end(), 0.5f);
  const Image scene = WavyPicture(48, 48, kDay);
  EXPECT_EQ(CountNotFinite(Make(scene)->Stylize(grey, 0), ""), 0);
  EXPECT_EQ(CountNotFinite(Make(grey)->Stylize(scene, 0), ""), 0);
}

TEST_F(CcplStylizer, F74_FilesThatDoNotFitEachOtherAreFoundBeforeAnyPhoto) {
  const Image style = WavyPicture(40, 40, kEvening);
  std::filesystem::remove(folder_ / "ccpl_expand.onnx");
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "ccpl_expand.onnx");
  // A code of other width than the style's, and an expansion that cuts edges off.
  testing::WriteText(folder_ / "ccpl_expand.onnx", Style());
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "ccpl_expand.onnx");
  WriteNetworks(folder_.path());
  testing::WriteText(folder_ / "ccpl_content.onnx", Style());
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "ccpl_content.onnx");
}

TEST(CcplPictures, PaddingReflectsAtRightAndBottom) {
  FeatureMap map(1, 8, 9);
  for (int i = 0; i < 72; ++i) map.values[static_cast<size_t>(i)] = static_cast<float>(i);
  const FeatureMap padded = Padded(map, 8);
  EXPECT_EQ(padded.height, 8);
  EXPECT_EQ(padded.width, 16);
  EXPECT_EQ(padded.plane(0)[8], 8);
  EXPECT_EQ(padded.plane(0)[9], 7);  // the edge itself is not repeated
  EXPECT_EQ(padded.plane(0)[15], 1);
  EXPECT_EQ(padded.plane(0)[7 * 16 + 9], 7 * 9 + 7);
}

}  // namespace
}  // namespace regrade
