// CAP-VSTNet's way through its two segments, with tiny networks: a turn of the colours and
// back.
#include "stylize/image/capvst_stylizer.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/image/color_statistics.h"
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

const std::vector<float> kTurn{0.6f, 0.8f, 0, -0.8f, 0.6f, 0, 0, 0, 2};
const std::vector<float> kBack{0.6f, -0.8f, 0, 0.8f, 0.6f, 0, 0, 0, 0.5f};

std::string Segment(const std::string& from, const std::string& to,
                    const std::vector<float>& matrix) {
  TinyOnnx network;
  network.Input(from, 3);
  network.Weights("matrix", {3, 3, 1, 1}, matrix);
  network.Node("Conv", {from, "matrix"}, to, TinyOnnx::Integers("kernel_shape", {1, 1}));
  network.Output(to, 3);
  return network.Bytes();
}

// The lower triangular factor of a covariance.
Mat3d Factor(const Mat3d& c) {
  Mat3d l = kZeroMat3d;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = c(i, j);
      for (int k = 0; k < j; ++k) sum -= l(i, k) * l(j, k);
      l(i, j) = i == j ? std::sqrt(sum) : sum / l(j, j);
    }
  return l;
}

Mat3d Turn(const std::vector<float>& m) {
  Mat3d t;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) t(i, j) = m[static_cast<size_t>(3 * i + j)];
  return t;
}

// back L_S L_C^-1 turn (c - m_c) + m_s, by forward substitution.
Image Expected(const Image& photo, const Image& style) {
  const ColorStatistics of_photo = MeasureColor(photo), of_style = MeasureColor(style);
  const Mat3d turn = Turn(kTurn), back = Turn(kBack);
  // Covariances are those of n - 1.
  const auto factor = [&](const ColorStatistics& s, const Image& image) {
    Mat3d c = turn * s.covariance * turn.Transposed();
    const double n = static_cast<double>(image.num_pixels());
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) c(i, j) *= n / (n - 1);
    return Factor(c);
  };
  const Mat3d lc = factor(of_photo, photo), ls = factor(of_style, style);
  Image expected = photo;
  for (int64_t i = 0; i < photo.num_pixels(); ++i) {
    float* const p = &expected.pixels[static_cast<size_t>(3 * i)];
    const Vec3d d = turn * (Vec3d{p[0], p[1], p[2]} - of_photo.mean);
    Vec3d white;
    white.x = d.x / lc(0, 0);
    white.y = (d.y - lc(1, 0) * white.x) / lc(1, 1);
    white.z = (d.z - lc(2, 0) * white.x - lc(2, 1) * white.y) / lc(2, 2);
    const Vec3d color = back * (ls * white) + of_style.mean;
    for (int c = 0; c < 3; ++c) p[c] = static_cast<float>(std::clamp(color[c], 0.0, 1.0));
  }
  return expected;
}

class CapVstStylizer : public ::testing::Test {
 protected:
  void SetUp() override {
    Write("encoder", Segment("image", "code", kTurn));
    Write("decoder", Segment("code", "image", kBack));
  }
  void Write(const std::string& name, const std::string& bytes) {
    testing::WriteText(folder_.path() + "/capvst_" + name + ".onnx", bytes);
  }
  std::unique_ptr<ViewStylizer> Make(const Image& style, int max_side = 1024) const {
    return MakeOnnxStylizer(folder_.path(), max_side, style);
  }
  testing::TemporaryFolder folder_;
};

TEST_F(CapVstStylizer, FeaturesAreColouredByCholeskyFactors) {
  const Image photo = WavyPicture(64, 48, kDay), style = WavyPicture(40, 56, kEvening);
  const auto stylizer = Make(style);
  EXPECT_EQ(stylizer->Name(), "cap-vstnet");
  const Image styled = stylizer->Stylize(photo, 0);
  // Statistics of floats, a few roundings of values about 1.
  EXPECT_LE(LargestDifference(styled, Expected(photo, style)), 1e-5);
  EXPECT_GE(LargestDifference(styled, photo), 0.2);
}

TEST_F(CapVstStylizer, H27_AnySizeComesBackAsItWent) {
  const auto stylizer = Make(WavyPicture(40, 40, kEvening), 64);
  testing::ExpectAnySizeComesBack(*stylizer);
}

TEST_F(CapVstStylizer, H7_OneColourOnEitherSideStaysFinite) {
  const Image grey = testing::OneColour(32, 32, {0.4, 0.4, 0.4});
  const Image photo = WavyPicture(64, 48, kDay);
  // A photo of one colour takes the style's mean.
  const Image style = WavyPicture(40, 56, kEvening);
  const Vec3d mean = MeasureColor(style).mean;
  const Image flat = Make(style)->Stylize(grey, 0);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(flat.pixels[static_cast<size_t>(c)], mean[c], 1e-4);
  // A style of one colour takes nearly all contrast: the ridge of 2e-5 leaves 0.0045 of a
  // standard deviation, and the wave has no pixel beyond five.
  const Image styled = Make(grey)->Stylize(photo, 0);
  for (const float v : styled.pixels) ASSERT_NEAR(v, 0.4f, 5 * 0.0045);
}

TEST_F(CapVstStylizer, F74_FilesThatDoNotFitEachOtherAreFoundBeforeAnyPhoto) {
  const Image style = WavyPicture(32, 32, kEvening);
  Make(style);
  std::filesystem::remove(folder_.path() + "/capvst_decoder.onnx");
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "capvst_decoder.onnx");
  Write("decoder", Segment("image", "code", kTurn));  // the other way
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "capvst_decoder.onnx");
  Write("decoder", Segment("code", "image", kBack));
  Make(style);
  Write("encoder", Segment("image", "feat", kTurn));
  EXPECT_REGRADE_ERROR(Make(style), ExitCode::kExternalProgram, "capvst_encoder.onnx");
}

}  // namespace
}  // namespace regrade
