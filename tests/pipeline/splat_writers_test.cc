// What the writers of SPZ and compressed PLY write, read again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/splats/covariance.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/compressed_ply_writer.h"
#include "pipeline/fields/morton_order.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/spz_writer.h"
#include "pipeline/files/deflate.h"
#include "tests/support/data.h"
#include "tests/support/small_splats.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::RandomSplats;
using testing::ReadText;
using testing::TemporaryFolder;

Splats ToWrite(int basis, int64_t count = 600) {
  return CastSplats<float>(RandomSplats(count, basis, 5));
}

// The most that a value of a splat may be off.
struct Bounds {
  double mean, log_scale, color, harmonic1, harmonic;
};

double OpacityOf(float logit) { return 1 / (1 + std::exp(-double{logit})); }

void ExpectSplatNear(const ColoredSplat& a, const ColoredSplat& b, int basis,
                     const Bounds& bounds) {
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(a.splat.mean[axis], b.splat.mean[axis], bounds.mean);
    EXPECT_NEAR(a.splat.log_scale[axis], b.splat.log_scale[axis], bounds.log_scale);
  }
  // Half a step, and the quarter by which LogitOfByte keeps away from the ends.
  EXPECT_NEAR(OpacityOf(a.splat.opacity_logit), OpacityOf(b.splat.opacity_logit), 0.75 / 255);
  float one[4], other[4];
  UnitQuaternion(a.splat.quaternion, one);
  UnitQuaternion(b.splat.quaternion, other);
  double cosine = 0;
  for (int k = 0; k < 4; ++k) cosine += double{one[k]} * double{other[k]};
  // Three components are off by at most 0.0007, the largest by at most sqrt(3) times as much
  // as their length: in all 0.0024, the sine of half the angle.
  EXPECT_GT(std::abs(cosine), 1 - 3e-6);
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < basis; ++k)
      EXPECT_NEAR(a.sh[c * basis + k], b.sh[c * basis + k],
                  k == 0  ? bounds.color
                  : k < 4 ? bounds.harmonic1
                          : bounds.harmonic)
          << c << " " << k;
}

void ExpectNear(const Splats& written, const SplatScene& scene, const Bounds& bounds) {
  EXPECT_EQ(scene.records, written.count());
  EXPECT_EQ(scene.dropped, 0);
  EXPECT_TRUE(scene.ignored.empty());
  EXPECT_TRUE(scene.notes.empty());
  ASSERT_EQ(scene.splats.count(), written.count());
  ASSERT_EQ(scene.splats.basis, written.basis);
  const std::vector<int64_t> order = MortonOrder(written.view());
  for (int64_t i = 0; i < written.count(); ++i)
    ExpectSplatNear(SplatAt(scene.splats.view(), i),
                    SplatAt(written.view(), order[static_cast<size_t>(i)]), written.basis,
                    bounds);
}

TEST(MortonOrder, IsAlongTheCurveAndOfTheMeansAlone) {
  Splats corners(8, 1);
  std::vector<int64_t> expected;
  for (int k = 0; k < 8; ++k) {  // x is the slowest; the indices are mixed
    expected.push_back((5 * k + 3) % 8);
    corners.Set(
        expected.back(),
        {{-3 + 8.0f * (k >> 2), 2 + 4.0f * (k >> 1 & 1), -7 + 6.0f * (k & 1)}, {}, {}, 0});
  }
  EXPECT_EQ(MortonOrder(corners.view()), expected);
  Splats one_place(3, 1);
  EXPECT_EQ(MortonOrder(one_place.view()), (std::vector<int64_t>{0, 1, 2}));
}

TEST(WriteSpz, ComesBackWithinHalfAStep) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9, 16})
    for (const bool antialiased : {false, true}) {
      const Splats splats = ToWrite(basis);
      WriteSpz(folder / "a.spz", splats, antialiased);
      const SplatScene scene = ReadSplats(folder / "a.spz");
      EXPECT_EQ(scene.format, SplatFormat::kSpz);
      EXPECT_EQ(scene.antialiased, antialiased);
      // Means are below 1.2: 22 bits behind the point. A colour's step is 1 / (255 * 0.15).
      ExpectNear(splats, scene,
                 {0.51 / (1 << 22), 0.51 / 16, 0.51 / 38.25, 0.51 / 32, 0.51 / 16});
    }
}

TEST(WriteSpz, ASplatFarOutsideLeavesTheOthersAsFine) {
  const TemporaryFolder folder;
  const Splats near = ToWrite(4);
  Splats splats = near;
  splats.mean[0] = 4e4f, splats.mean[1] = 3e4f, splats.mean[2] = 0;
  splats.log_scale[0] = 3;
  WriteSpz(folder / "a.spz", splats, false);
  const SplatScene scene = ReadSplats(folder / "a.spz");
  ASSERT_EQ(scene.splats.count(), splats.count());
  const std::vector<int64_t> order = MortonOrder(splats.view());
  for (int64_t i = 0; i < splats.count(); ++i) {
    const ColoredSplat back = SplatAt(scene.splats.view(), i);
    const int64_t of = order[static_cast<size_t>(i)];
    if (of != 0) {
      EXPECT_LT(Norm(back.splat.mean - SplatAt(near.view(), of).splat.mean), 2e-5f);
      continue;
    }
    // Drawn in to a hundred times the distance of half of the splats, which is .7 or so.
    const double distance = Norm(back.splat.mean);
    EXPECT_TRUE(distance > 30 && distance < 150) << distance;
    EXPECT_NEAR(back.splat.mean.x / distance, 0.8, 0.01);
    EXPECT_NEAR(back.splat.log_scale.x, 3 + std::log(distance / 5e4), 0.1);
  }
}

// Unpacked a header of 16 bytes, then 9 + 1 + 3 + 3 + 4 + 45 for each splat.
TEST(WriteSpz, IsAGzipFileOfVersion3) {
  const TemporaryFolder folder;
  WriteSpz(folder / "a.spz", ToWrite(16, 7), true);
  const std::string bytes = Gunzip(ReadText(folder / "a.spz"), 1 << 20, "test");
  EXPECT_EQ(bytes.size(), 16 + 7 * 65u);
  EXPECT_EQ(bytes.substr(0, 16), std::string("NGSP\3\0\0\0\7\0\0\0\3\x16\1\0", 16));
  int finest[2] = {0, 0};  // of degree 1, and of others
  for (size_t at = 16 + 7 * 20; at < bytes.size(); ++at) {
    const size_t k = 1 + (at - 16 - 7 * 20) % 45 / 3;
    finest[k >= 4] |= static_cast<uint8_t>(bytes[at]);
  }
  EXPECT_EQ(finest[0] & 7, 4);
  EXPECT_EQ(finest[1] & 15, 8);
}

TEST(WriteSpz, WhatIsBeyondTheFormatIsLimited) {
  const TemporaryFolder folder;
  Splats splats = ToWrite(4, 2);
  splats.mean = {3e5f, -1, 0, -2e5f, 1, 2};
  splats.log_scale = {-40, 40, 0, 0, 0, 0};
  splats.opacity_logit[0] = 20;
  splats.sh[1] = 3, splats.sh[2] = -3, splats.sh[0] = 9;
  WriteSpz(folder / "a.spz", splats, false);
  const SplatScene scene = ReadSplats(folder / "a.spz");
  const int64_t first = scene.splats.view()[0].mean.x > 0 ? 0 : 1;
  const ColoredSplat back = SplatAt(scene.splats.view(), first);
  EXPECT_EQ(back.splat.mean.x, 3e5f);
  EXPECT_EQ(back.splat.log_scale.x, -10);
  EXPECT_EQ(back.splat.log_scale.y, 255 / 16.0f - 10);
  EXPECT_EQ(back.splat.opacity_logit, LogitOfByte(255));
  EXPECT_EQ(back.sh[1], 1);  // up and back: -1 in the file
  EXPECT_EQ(back.sh[2], -127 / 128.0f);
  EXPECT_NEAR(back.sh[0], 0.5 / 0.15, 1e-6);
  splats.mean[0] = 1e9f;
  WriteSpz(folder / "a.spz", splats, false);
  const Splats limited = ReadSplats(folder / "a.spz").splats;
  EXPECT_EQ(std::max(limited.mean[0], limited.mean[3]), (1 << 23) - 1);
}

TEST(WriteCompressedPly, ComesBackWithinHalfAStepOfWhatAChunkSpans) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9, 16})
    for (const bool antialiased : {false, true}) {
      const int64_t chunks = basis == 1 ? 2 : 3, count = basis == 1 ? 512 : 600;
      const Splats splats = ToWrite(basis, count);
      WriteCompressedPly(folder / "a.ply", splats, antialiased, "a comment");
      const SplatScene scene = ReadSplats(folder / "a.ply");
      EXPECT_EQ(scene.format, SplatFormat::kCompressedPly);
      EXPECT_EQ(scene.antialiased, antialiased);
      // Means span 2.4, scales log(8), colours 1.2; a harmonic's byte is 1/32.
      ExpectNear(splats, scene,
                 {0.51 * 2.4 / 1023, 0.51 * std::log(8.0) / 1023, 0.51 * 1.2 / 255, 0.51 / 32,
                  0.51 / 32});
      const std::string file = ReadText(folder / "a.ply");
      EXPECT_EQ(std::ssize(file), static_cast<int64_t>(file.find("end_header\n")) + 11 +
                                      72 * chunks + count * (16 + 3 * (basis - 1)));
      EXPECT_NE(file.find("comment a comment\n"), std::string::npos);
    }
}

TEST(WriteCompressedPly, OneSplatAndALimit) {
  const TemporaryFolder folder;
  Splats splats = ToWrite(4, 1);
  splats.log_scale = {-40, 1, 2};
  splats.sh[1] = 9, splats.sh[2] = -9;
  WriteCompressedPly(folder / "a.ply", splats, false, "");
  const ColoredSplat back = SplatAt(ReadSplats(folder / "a.ply").splats.view(), 0);
  EXPECT_EQ(back.splat.mean, splats.view()[0].mean);
  EXPECT_EQ(back.splat.log_scale, (Vec3f{-20, 1, 2}));
  EXPECT_EQ(back.sh[1], 4);
  EXPECT_EQ(back.sh[2], -4);
}

// 26 bytes a splat for SPZ, 16.3 and 61.3 for compressed PLY.
TEST(SplatWriters, SizesOfARealScene) {
  REGRADE_NEED_DATA("splats/fox_mcmc_60k.ply");
  const TemporaryFolder folder;
  const Splats fox = ReadSplats(testing::DataPath("splats/fox_mcmc_60k.ply")).splats;
  WriteSpz(folder / "fox.spz", fox, false);
  WriteCompressedPly(folder / "fox.ply", fox, false, "");
  const auto size = [&](const char* name) {
    return static_cast<double>(std::filesystem::file_size(folder / name)) / 60000;
  };
  EXPECT_LT(size("fox.spz"), 27);
  EXPECT_LT(size("fox.ply"), 61.35);
}

}  // namespace
}  // namespace regrade
