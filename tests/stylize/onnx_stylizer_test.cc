#include "stylize/image/onnx_stylizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "kernels/image/color_statistics.h"
#include "stylize/image/onnx_network.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/threads.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

using testing::DataPath;
using testing::kDay;
using testing::kEvening;
using testing::MeanDifference;
using testing::WavyPicture;

const std::string kPcaKd = "weights/pca_kd_mobilenet";

double Distance(const Image& a, const Image& b) {
  const Vec3d d = MeasureColor(a).mean - MeasureColor(b).mean;
  return std::sqrt(Dot(d, d));
}

TEST(OnnxStylizer, PcaKdMovesColoursToTheStyleAndKeepsThePhoto) {
  for (const char* set : {"weights/pca_kd_mobilenet", "weights/pca_kd_vgg"}) {
    REGRADE_NEED_DATA(set);
    const Image photo = WavyPicture(150, 109, kDay), style = WavyPicture(96, 128, kEvening);
    const auto stylizer = MakeOnnxStylizer(DataPath(set), 1024, style);
    const Image styled = stylizer->Stylize(photo, 3);
    EXPECT_EQ(CheckStyledView(photo, styled, "view 3"), 0);
    EXPECT_LE(Distance(styled, style), 0.5 * Distance(photo, style)) << set;
    // The same again, after pictures of other sizes: a net keeps no trace of them.
    stylizer->Stylize(WavyPicture(64, 48, kEvening), 0);
    EXPECT_EQ(stylizer->Stylize(photo, 3).pixels, styled.pixels) << set;
    // Its own style changes a photo little: the networks are an auto-encoder then. 0.05 is
    // three times what both sets show.
    const auto own = MakeOnnxStylizer(DataPath(set), 1024, photo);
    EXPECT_LE(MeanDifference(own->Stylize(photo, 0), photo), 0.05) << set;
  }
}

TEST(OnnxStylizer, SameBytesForAnyNumberOfThreads) {
  REGRADE_NEED_DATA(kPcaKd);
  const Image photo = WavyPicture(150, 109, kDay), style = WavyPicture(96, 128, kEvening);
  std::vector<Image> styled;
  for (const int n : {3, 2, 1}) {
    const testing::Threads threads(n);
    styled.push_back(MakeOnnxStylizer(DataPath(kPcaKd), 1024, style)->Stylize(photo, 0));
  }
  EXPECT_EQ(styled[0].pixels, styled[1].pixels);
  EXPECT_EQ(styled[0].pixels, styled[2].pixels);
}

TEST(OnnxStylizer, H27_AnySizeComesBackAsItWent) {
  REGRADE_NEED_DATA(kPcaKd);
  const auto stylizer = MakeOnnxStylizer(DataPath(kPcaKd), 64, WavyPicture(40, 40, kEvening));
  testing::ExpectAnySizeComesBack(*stylizer);
}

TEST(OnnxStylizer, H7_H26_OneColourOnEitherSideStaysFinite) {
  REGRADE_NEED_DATA(kPcaKd);
  Image grey(48, 48);  // of one colour
  std::fill(grey.pixels.begin(), grey.pixels.end(), 0.5f);
  const Image scene = WavyPicture(48, 48, kDay);
  using Pair = std::pair<const Image*, const Image*>;
  for (const auto& [photo, style] :
       {Pair{&grey, &scene}, Pair{&scene, &grey}, Pair{&grey, &grey}}) {
    const Image styled = MakeOnnxStylizer(DataPath(kPcaKd), 1024, *style)->Stylize(*photo, 0);
    EXPECT_EQ(CountNotFinite(styled, ""), 0);
  }
}

TEST(OnnxStylizer, H29_PixelsThatAreNotFiniteSpoilNoOthers) {
  REGRADE_NEED_DATA(kPcaKd);
  Image photo = WavyPicture(64, 64, kDay);
  photo.at(5, 6)[1] = std::numeric_limits<float>::quiet_NaN();
  const Image styled = MakeOnnxStylizer(DataPath(kPcaKd), 1024, WavyPicture(64, 64, kEvening))
                           ->Stylize(photo, 0);
  EXPECT_EQ(CountNotFinite(styled, ""), 1);
}

TEST(OnnxStylizer, ALargePhotoIsWorkedOnSmallAndKeepsItsDetail) {
  REGRADE_NEED_DATA(kPcaKd);
  const Image photo = WavyPicture(256, 192, kDay), style = WavyPicture(96, 96, kEvening);
  const Image whole = MakeOnnxStylizer(DataPath(kPcaKd), 1024, style)->Stylize(photo, 0);
  const Image small = MakeOnnxStylizer(DataPath(kPcaKd), 128, style)->Stylize(photo, 0);
  EXPECT_EQ(CheckStyledView(photo, small, "view 0"), 0);
  EXPECT_LE(MeanDifference(whole, small), 0.06);
}

TEST(OnnxStylizer, WctMovesColoursToTheStyle) {
  REGRADE_NEED_DATA("weights/vgg19_wct");
  const Image photo = WavyPicture(70, 53, kDay), style = WavyPicture(64, 64, kEvening);
  const Image styled =
      MakeOnnxStylizer(DataPath("weights/vgg19_wct"), 1024, style)->Stylize(photo, 0);
  EXPECT_EQ(CheckStyledView(photo, styled, "view 0"), 0);
  EXPECT_LE(Distance(styled, style), 0.6 * Distance(photo, style));
}

TEST(OnnxStylizer, F73_WhatIsNotANetworkIsNamedWithARemedy) {
  const testing::TemporaryFolder folder;
  const Image style = WavyPicture(32, 32, kEvening);
  const auto make = [&](const std::string& path) { MakeOnnxStylizer(path, 1024, style); };
  EXPECT_REGRADE_ERROR(make(folder / "none"), ExitCode::kExternalProgram, "none");
  EXPECT_REGRADE_ERROR(make(folder.path()), ExitCode::kExternalProgram, "no encoder.onnx");
  testing::WriteText(folder / "a/encoder.onnx", "");
  EXPECT_REGRADE_ERROR(make(folder / "a"), ExitCode::kExternalProgram, "empty");
  testing::WriteText(folder / "b/encoder.onnx", "\x89PNG\r\n and no network at all");
  EXPECT_REGRADE_ERROR(make(folder / "b"), ExitCode::kExternalProgram, "b/encoder.onnx");
  testing::WriteText(folder / "photo.jpg", std::string(4000, 'x'));
  EXPECT_REGRADE_ERROR(make(folder / "photo.jpg"), ExitCode::kExternalProgram, "not an ONNX");
}

TEST(OnnxStylizer, F74_FilesThatDoNotFitEachOtherAreFoundBeforeAnyPhoto) {
  REGRADE_NEED_DATA(kPcaKd);
  namespace fs = std::filesystem;
  const testing::TemporaryFolder folder;
  const Image style = WavyPicture(32, 32, kEvening);
  const auto make = [&] { MakeOnnxStylizer(folder.path(), 1024, style); };
  const auto copy = [&](const std::string& from, const std::string& to) {
    fs::remove(folder / to);
    fs::copy_file(DataPath(from), folder / to);
  };
  copy(kPcaKd + "/encoder.onnx", "encoder.onnx");
  EXPECT_REGRADE_ERROR(make(), ExitCode::kExternalProgram, "decoder1.onnx");  // missing
  for (const char* name : {"decoder1.onnx", "decoder2.onnx", "decoder3.onnx", "decoder4.onnx"})
    copy(kPcaKd + "/" + name, name);
  make();
  copy(kPcaKd + "/decoder2.onnx", "decoder3.onnx");  // other channels
  EXPECT_REGRADE_ERROR(make(), ExitCode::kExternalProgram, "decoder3.onnx");
  copy(kPcaKd + "/encoder.onnx", "decoder3.onnx");  // no input "feat"
  EXPECT_REGRADE_ERROR(make(), ExitCode::kExternalProgram, "decoder3.onnx");
  copy(kPcaKd + "/decoder3.onnx", "decoder3.onnx");
  copy(kPcaKd + "/decoder3.onnx", "encoder.onnx");  // lacks the layers
  EXPECT_REGRADE_ERROR(make(), ExitCode::kExternalProgram, "encoder.onnx");
}

TEST(OnnxNetwork, F74_OutputsThatAreNotFiniteAreErrors) {
  REGRADE_NEED_DATA(kPcaKd);
  const OnnxNetwork encoder(DataPath(kPcaKd + "/encoder.onnx"));
  FeatureMap picture(3, 32, 32);
  EXPECT_EQ(encoder.Run({{"image", &picture}}, {"s1"})[0].height, 32);
  picture.values[100] = std::numeric_limits<float>::infinity();
  EXPECT_REGRADE_ERROR(encoder.Run({{"image", &picture}}, {"s1"}), ExitCode::kExternalProgram,
                       "not finite");
  EXPECT_REGRADE_ERROR(encoder.Run({{"image", &picture}}, {"s9"}), ExitCode::kExternalProgram,
                       "s9");
}

}  // namespace
}  // namespace regrade
