// SPZ, compressed PLY and .splat: against numbers worked out by hand, and against pictures.
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/base/random.h"
#include "kernels/splats/render_picture.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/files/deflate.h"
#include "pipeline/files/zstd.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/splat_bytes.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CompressedPlyOf;
using testing::CompressedPlyStyle;
using testing::LittleEndian;
using testing::SpzSplat;
using testing::TemporaryFolder;
using testing::UnpackedSpz;

SplatScene Read(const std::string& bytes) {
  const TemporaryFolder folder;
  testing::WriteText(folder / "a", bytes);
  return ReadSplats(folder / "a");
}

void ExpectNear(const std::vector<float>& values, const std::vector<double>& expected) {
  ASSERT_EQ(values.size(), expected.size());
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-5) << i;
}

// Position (1, -2, 1/4096) up and back is (1, 2, -1/4096) down and front; a turn by the angle
// with sin 1/2 = 0.6 about y becomes one about -y; the scales' axes stay.
constexpr SpzSplat kByHand = {{4096, -2 * 4096, 1}, 51, {255, 0, 128}, {160, 144, 176}, 0, {}};

void ExpectByHand(const SplatScene& scene, double tolerance) {
  EXPECT_EQ(scene.format, SplatFormat::kSpz);
  ASSERT_EQ(scene.splats.count(), 1);
  const SplatsView<float> view = scene.splats.view();
  ExpectNear(scene.splats.mean, {1, 2, -1.0 / 4096});
  ExpectNear(scene.splats.log_scale, {0, -1, 1});
  EXPECT_NEAR(view.opacity_logit[0], std::log(0.2 / 0.8), 1e-5);
  EXPECT_NEAR(view.Coefficients(0)[0], 0.5 / 0.15, 1e-5);
  EXPECT_NEAR(view.Coefficients(0)[view.basis], -0.5 / 0.15, 1e-5);
  EXPECT_NEAR(view.Coefficients(0)[2 * view.basis], (128 / 255.0 - 0.5) / 0.15, 1e-5);
  const double half = 0.6, cosine = 0.8;
  const double turn[4] = {cosine, 0, -half, 0};
  const Mat3d expected = RotationOf(turn),
              rotation = RotationOf(view.quaternion).Cast<double>();
  // A Gaussian does not change where two of its axes are reversed.
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(std::abs(rotation(i, j)), std::abs(expected(i, j)), tolerance) << i << j;
  EXPECT_GT(rotation(0, 0) * rotation(2, 0) * expected(0, 0) * expected(2, 0), 0);
}

TEST(Spz, Version2) {
  SpzSplat splat = kByHand;
  splat.rotation = 128 | 204 << 8 | 127 << 16;  // 0.6 = 204 / 127.5 - 1
  ExpectByHand(Read(UnpackedSpz(2, 0, {splat})), 0.02);
  ExpectByHand(Read(Gzip(UnpackedSpz(2, 0, {splat}))), 0.02);
}

TEST(Spz, Version3And4) {
  SpzSplat splat = kByHand;
  // w is the largest; x, y and z in 511ths of sqrt(1/2).
  splat.rotation = 3u << 30 | 434u << 10;
  ExpectByHand(Read(Gzip(UnpackedSpz(3, 0, {splat}))), 2e-3);
  splat.rotation = 0;  // x is the largest, and the others are 0
  const SplatScene about_x = Read(UnpackedSpz(3, 0, {splat}));
  EXPECT_NEAR(std::abs(RotationOf(about_x.splats.view().quaternion)(0, 0)), 1, 1e-6);
  if (!HaveZstd()) GTEST_SKIP() << "built without libzstd";
  splat.rotation = 3u << 30 | 434u << 10;
  ExpectByHand(Read(testing::SpzOf4(0, {splat})), 2e-3);
}

TEST(Spz, AllHarmonicsHaveTheirPlaces) {
  SpzSplat splat = kByHand;
  for (int k = 0; k < 24; ++k) splat.sh.push_back(static_cast<uint8_t>(128 + k + 1));
  // Right, down, front: as it is.
  const SplatScene scene = Read(UnpackedSpz(3, 2, {splat}, 3, testing::SpzAxes(6)));
  EXPECT_TRUE(scene.antialiased);
  EXPECT_EQ(scene.splats.basis, 9);
  ExpectNear(scene.splats.mean, {1, -2, 1.0 / 4096});
  for (int c = 0; c < 3; ++c)
    for (int k = 1; k < 9; ++k)
      EXPECT_NEAR(scene.splats.view().Coefficients(0)[9 * c + k], (3 * (k - 1) + c + 1) / 128.0,
                  1e-6);
}

SpzSplat RandomSpzSplat(uint64_t i) {
  SpzSplat splat{};
  auto below = [i, part = uint64_t{0}](uint64_t n) mutable {
    return static_cast<uint32_t>(RandomIndex(3, i, part++, n));
  };
  for (int32_t& p : splat.position) p = static_cast<int32_t>(below(8000)) - 4000;
  splat.opacity = static_cast<uint8_t>(60 + below(190));
  for (uint8_t& c : splat.color) c = static_cast<uint8_t>(below(256));
  for (uint8_t& s : splat.scale) s = static_cast<uint8_t>(115 + below(35));
  splat.rotation = below(4) << 30;
  for (int q = 0; q < 3; ++q) splat.rotation |= (below(2) << 9 | below(360)) << 10 * q;
  for (int k = 0; k < 45; ++k) splat.sh.push_back(static_cast<uint8_t>(98 + below(60)));
  return splat;
}

// Positions, rotations and harmonics turn with the axes: the picture is that of a camera that
// is turned the other way, of the file's numbers as they are. Kind 6 is right, down, front; 8,
// a reflection of it, is right, up, front.
TEST(Spz, AxesTurnAllThatHasADirection) {
  std::vector<SpzSplat> splats;
  for (uint64_t i = 0; i < 60; ++i) splats.push_back(RandomSpzSplat(i));
  const Splats as_stored = Read(UnpackedSpz(3, 3, splats, 2, testing::SpzAxes(6))).splats;
  const Camera camera = testing::SplatCameraOf(61, 43);
  for (const auto& [kind, signs] :
       {std::pair{0u, Vec3d{1, -1, -1}}, std::pair{4u, Vec3d{1, -1, -1}},
        std::pair{1u, Vec3d{-1, 1, -1}}, std::pair{7u, Vec3d{-1, -1, 1}},
        std::pair{8u, Vec3d{1, -1, 1}}}) {
    const Splats turned = Read(UnpackedSpz(3, 3, splats, 2, testing::SpzAxes(kind))).splats;
    Camera in_file = camera;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) in_file.camera_from_world.rotation(i, j) *= signs[j];
    const auto a = RenderSplatsPlain(as_stored.view(), in_file, {}),
               b = RenderSplatsPlain(turned.view(), camera, {}),
               other = RenderSplatsPlain(as_stored.view(), camera, {});
    double worst = 0, change = 0;
    for (size_t p = 0; p < a.color.size(); ++p) {
      worst = std::max(worst, double{std::abs(a.color[p] - b.color[p])});
      change = std::max(change, double{std::abs(a.color[p] - other.color[p])});
    }
    EXPECT_LT(worst, 1e-4) << kind;
    EXPECT_GT(change, 0.1) << kind;  // the test can fail
  }
}

TEST(Spz, ExtensionsAreNamedAndOtherAxesRefused) {
  const std::string other =
      LittleEndian(0xADBE0002u) + LittleEndian(12u) + std::string(12, 'x');
  EXPECT_EQ(Read(UnpackedSpz(3, 0, {kByHand}, 2, other)).ignored,
            std::vector<std::string>{"extension 0xADBE0002"});
  EXPECT_REGRADE_ERROR(Read(UnpackedSpz(3, 0, {kByHand}, 2, testing::SpzAxes(9))),
                       ExitCode::kInput, "axes of kind 9");
  EXPECT_REGRADE_ERROR(Read(UnpackedSpz(3, 0, {kByHand}, 2, other.substr(0, 12))),
                       ExitCode::kInput, "an extension goes beyond the end");
}

TEST(Spz, Version4HasItsExtensionsInFront) {
  if (!HaveZstd()) GTEST_SKIP() << "built without libzstd";
  const std::string other = LittleEndian(0xADBE0002u) + LittleEndian(0u);
  SpzSplat splat = kByHand;
  splat.sh.assign(9, 130);
  const SplatScene scene = Read(testing::SpzOf4(1, {splat}, 2, other + testing::SpzAxes(6)));
  EXPECT_EQ(scene.ignored, std::vector<std::string>{"extension 0xADBE0002"});
  ExpectNear(scene.splats.mean, {1, -2, 1.0 / 4096});
  EXPECT_EQ(scene.splats.sh[1], 2 / 128.0f);
}

TEST(Spz, Degree4LosesItsLastHarmonics) {
  SpzSplat splat = kByHand;
  splat.sh.assign(72, 130);
  const SplatScene scene = Read(UnpackedSpz(3, 4, {splat, splat}));
  EXPECT_EQ(scene.splats.basis, 16);
  EXPECT_EQ(scene.notes.size(), 1u);
}

TEST(Spz, LyingHeadersAreRefused) {
  std::string file = UnpackedSpz(3, 0, {kByHand, kByHand});
  for (const uint32_t count : {3u, 1u << 31, ~0u}) {
    file.replace(8, 4, LittleEndian(count));
    EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "its header says");
    EXPECT_REGRADE_ERROR(Read(Gzip(file)), ExitCode::kInput, "its header says");
  }
  file.replace(8, 4, LittleEndian(0u));
  EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "there are no splats");
  for (const uint32_t version : {0u, 1u, 5u, 0xffffff03u}) {
    file.replace(4, 4, LittleEndian(version));
    EXPECT_REGRADE_ERROR(Read(Gzip(file)), ExitCode::kInput, "2 to 4 are read");
  }
  for (const size_t place : {12, 13}) {  // the degree and the fractional bits
    std::string odd = UnpackedSpz(3, 0, {kByHand});
    odd[place] = 99;
    EXPECT_REGRADE_ERROR(Read(odd), ExitCode::kInput, "99");
  }
  EXPECT_REGRADE_ERROR(Read("NGSP"), ExitCode::kInput, "no header");
  EXPECT_REGRADE_ERROR(Read(Gzip("a text")), ExitCode::kInput, "but not of splats");
  EXPECT_REGRADE_ERROR(Read("\x1f\x8b"), ExitCode::kInput, "damaged");
}

TEST(Spz, BombsAreRefused) {
  std::string many = UnpackedSpz(3, 0, {kByHand});
  many.replace(8, 4, LittleEndian(3u << 20));
  EXPECT_REGRADE_ERROR(Read(Gzip(many + std::string(60 << 20, '\0'))), ExitCode::kInput,
                       "unpacks to more than");
  std::string four = testing::SpzOf4(0, {kByHand});
  four.replace(8, 4, LittleEndian(3u << 20));
  EXPECT_REGRADE_ERROR(Read(four), ExitCode::kInput, "its header says 3145728 splats");
  if (!HaveZstd()) GTEST_SKIP() << "built without libzstd";
  // A size in the table, and one in a stream's frame, that are not what the header asks for.
  four = testing::SpzOf4(0, {kByHand});
  four.replace(40, 8, LittleEndian(uint64_t{1} << 40));
  EXPECT_REGRADE_ERROR(Read(four), ExitCode::kInput, "disagrees with its header");
  four = testing::SpzOf4(0, {kByHand});
  four.replace(four.find("\x28\xb5\x2f\xfd") + 5, 4, LittleEndian(1u << 30));
  EXPECT_REGRADE_ERROR(Read(four), ExitCode::kInput, "damaged");
}

TEST(Spz, APartOfAFileIsRefused) {
  for (const std::string& file :
       {UnpackedSpz(2, 0, {kByHand}), Gzip(UnpackedSpz(2, 0, {kByHand})),
        testing::SpzOf4(0, {kByHand})})
    for (size_t size = 0; size < file.size(); ++size)
      EXPECT_REGRADE_ERROR(Read(file.substr(0, size)), ExitCode::kInput, "");
}

// One chunk from -1 to 3, with colours from 0.25 to 0.75.
CompressedPlyStyle SmallCompressed() {
  CompressedPlyStyle style;
  for (int a = 0; a < 3; ++a) style.chunk.insert(style.chunk.end(), {-1, 3});
  for (int a = 0; a < 3; ++a) style.chunk.insert(style.chunk.end(), {-8, 0});
  for (int a = 0; a < 3; ++a) style.chunk.insert(style.chunk.end(), {0.25f, 0.75f});
  // The largest of w x y z is x; w, y and z are 0.1, 0.2 and -0.3 (of 1 / sqrt(2)).
  const auto ten = [](double q) {
    return static_cast<uint32_t>((q / std::sqrt(2) + 0.5) * 1023 + 0.5);
  };
  style.packed = {2047u << 21 | 0u << 11 | 1024u,
                  1u << 30 | ten(0.1) << 20 | ten(0.2) << 10 | ten(-0.3),
                  0u << 21 | 1023u << 11 | 2047u, 0x00ff80ccu};
  return style;
}

TEST(CompressedPly, ByHand) {
  CompressedPlyStyle style = SmallCompressed();
  const SplatScene scene = Read(CompressedPlyOf(style));
  EXPECT_EQ(scene.format, SplatFormat::kCompressedPly);
  ExpectNear(scene.splats.mean, {3, -1, -1 + 4 * 1024.0 / 2047});
  ExpectNear(scene.splats.log_scale, {-8, 0, 0});
  const std::vector<float>& q = scene.splats.quaternion;
  // Of 10 bits over a range of sqrt(2).
  EXPECT_NEAR(q[0], 0.1, 7e-4);
  EXPECT_NEAR(q[1], std::sqrt(1 - 0.01 - 0.04 - 0.09), 7e-4);
  EXPECT_NEAR(q[2], 0.2, 7e-4);
  EXPECT_NEAR(q[3], -0.3, 7e-4);
  ExpectNear(scene.splats.opacity_logit, {std::log(0.8 / 0.2)});
  ExpectNear(scene.splats.sh,
             {-0.25 / kSh0, 0.25 / kSh0, (0.25 + 0.5 * 128 / 255 - 0.5) / kSh0});

  style.colors = false;
  style.chunk.resize(12);
  style.degree = 1;
  style.sh = {0, 255, 128, 127, 1, 2, 3, 4, 5};
  const SplatScene other = Read(CompressedPlyOf(style));
  EXPECT_EQ(other.splats.basis, 4);
  const auto s = [](int byte) { return 8 * ((byte + 0.5) / 256 - 0.5); };
  ExpectNear(other.splats.sh, {-0.5 / kSh0, -4, 4, s(128), 0.5 / kSh0, s(127), s(1), s(2),
                               (128 / 255.0 - 0.5) / kSh0, s(3), s(4), s(5)});
}

TEST(CompressedPly, WhatDisagreesIsRefused) {
  CompressedPlyStyle style = SmallCompressed();
  style.chunk.insert(style.chunk.end(), style.chunk.begin(), style.chunk.end());
  EXPECT_REGRADE_ERROR(Read(CompressedPlyOf(style)), ExitCode::kInput, "1 splats in 2 chunks");
  std::string file = CompressedPlyOf(SmallCompressed());
  for (size_t size = file.find("end_header"); size < file.size(); ++size)
    EXPECT_REGRADE_ERROR(Read(file.substr(0, size)), ExitCode::kInput, "");
  file.replace(file.find("uint packed_color"), 17, "uint packed_colos");
  EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "no packed_color");
  style = SmallCompressed();
  style.chunk[0] = std::nanf("");
  EXPECT_REGRADE_ERROR(Read(CompressedPlyOf(style)), ExitCode::kInput, "none of its 1 splats");
}

TEST(DotSplat, ByHand) {
  std::string record;
  for (const float value : {1.0f, 2.0f, -3.0f, 1.0f, 0.0f, std::exp(1.0f)})
    record += LittleEndian(value);
  record += std::string("\xff\x00\x80\x33", 4) + std::string("\xc0\x80\x40\x80", 4);
  const SplatScene scene = Read(record);
  EXPECT_EQ(scene.format, SplatFormat::kSplat);
  ExpectNear(scene.splats.mean, {1, 2, -3});
  ExpectNear(scene.splats.log_scale, {0, -50, 1});  // a disc: kMaxLogScale
  ExpectNear(scene.splats.quaternion, {0.5, 0, -0.5, 0});
  ExpectNear(scene.splats.opacity_logit, {std::log(0.2 / 0.8)});
  ExpectNear(scene.splats.sh, {0.5 / kSh0, -0.5 / kSh0, (128 / 255.0 - 0.5) / kSh0});
  EXPECT_REGRADE_ERROR(Read(record + "x"), ExitCode::kInput, "not a file of splats");
  EXPECT_REGRADE_ERROR(Read(std::string(32, 'x')), ExitCode::kInput, "not a file of splats");
}

TEST(SplatFiles, OtherFormatsAreNamedWithTheirConverter) {
  for (const std::string& bytes :
       {std::string("PK\x03\x04rest"), std::string("{\"version\":2}"),
        std::string("\0\1\0\0", 4) + std::string(5000, '\0'), std::string("glTF\2\0\0\0", 8)})
    EXPECT_REGRADE_ERROR(Read(bytes), ExitCode::kInput, "splat-transform");
  EXPECT_REGRADE_ERROR(Read("a text"), ExitCode::kInput, "splat-transform");
  EXPECT_REGRADE_ERROR(Read(""), ExitCode::kInput, "empty");
}

TEST(SplatFiles, RealPackedFilesAreRead) {
  REGRADE_NEED_DATA("splats/biker.compressed.ply");
  const SplatScene biker = ReadSplats(testing::DataPath("splats/biker.compressed.ply")),
                   guitar = ReadSplats(testing::DataPath("splats/guitar.compressed.ply"));
  EXPECT_EQ(biker.splats.count(), 152746);
  EXPECT_EQ(guitar.splats.count(), 90854);
  EXPECT_EQ(biker.dropped + guitar.dropped, 0);
  const std::string folder = testing::DataPath("splats/minimal_fixtures/");
  EXPECT_REGRADE_ERROR(ReadSplats(folder + "minimal.ksplat"), ExitCode::kInput, ".ksplat");
  // A square of four at y = 0, from -1 to 0 in x and z, of deviation 0.1 and opacity 0.9. That
  // the files of versions 3 and 4 have right, down, front as the frame of their source, is what
  // splat-transform's program that made them says; the first ones are in SPZ's axes.
  for (const auto& [name, z] :
       {std::pair{"minimal.splat", -1.0}, std::pair{"minimal-raw.spz", 1.0},
        std::pair{"minimal-v2.spz", 1.0}, std::pair{"minimal-v3.spz", -1.0},
        std::pair{"minimal-v4.spz", -1.0}}) {
    if (std::string(name).ends_with("v4.spz") && !HaveZstd()) continue;
    const SplatScene scene = ReadSplats(folder + name);
    SCOPED_TRACE(name);
    ExpectNear(scene.splats.mean, {-1, 0, z, 0, 0, z, -1, 0, 0, 0, 0, 0});
    for (const float l : scene.splats.log_scale) EXPECT_NEAR(std::exp(l), 0.1, 3e-3);
    for (const float o : scene.splats.opacity_logit)
      EXPECT_NEAR(1 / (1 + std::exp(-o)), 0.9, 3e-3);
    // The first two SPZ files have the byte of another scale of colours.
    EXPECT_NEAR(0.5 + kSh0 * scene.splats.sh[0], z > 0 ? 0.5 - kSh0 / 0.9 : 1 / 3.0, 0.01);
  }
}

}  // namespace
}  // namespace regrade
