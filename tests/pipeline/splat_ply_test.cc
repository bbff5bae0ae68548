// PLY files of Gaussians: what the reader accepts, and colours that are written back.
#include "pipeline/fields/splat_ply.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/splats/splat_field.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/restyled_ply.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/small_splats.h"
#include "tests/support/splat_bytes.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::ColorsOf;
using testing::PlyOf;
using testing::PlyStyle;
using testing::RandomSplats;
using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

Splats SomeSplats(int basis, int64_t count = 20) {
  return CastSplats<float>(RandomSplats(count, basis, 5));
}

SplatScene Read(const std::string& bytes) {
  const TemporaryFolder folder;
  WriteText(folder / "a.bin", bytes);
  return ReadSplats(folder / "a.bin");
}

void ExpectSame(const Splats& a, const Splats& b) {
  EXPECT_EQ(a.mean, b.mean);
  EXPECT_EQ(a.log_scale, b.log_scale);
  EXPECT_EQ(a.quaternion, b.quaternion);
  EXPECT_EQ(a.opacity_logit, b.opacity_logit);
  EXPECT_EQ(a.sh, b.sh);
  EXPECT_EQ(a.basis, b.basis);
}

// Bit for bit, but for the lengths of quaternions.
TEST(SplatFiles, WhatTheWriterWritesComesBack) {
  const TemporaryFolder folder;
  for (const int basis : {1, 4, 9, 16})
    for (const bool antialiased : {false, true}) {
      const Splats splats = SomeSplats(basis, 50);
      const StoredField stored{
          FieldOfSplats(splats, {{}, {}, {1, 1, 1}}, 0.2f, antialiased ? 0.0f : -1.0f), {}, {}};
      WriteSplatPly(folder / "field.ply", stored, "a comment");
      const SplatScene scene = ReadSplats(folder / "field.ply");
      EXPECT_EQ(scene.format, SplatFormat::kPly);
      EXPECT_EQ(scene.antialiased, antialiased);
      EXPECT_EQ(scene.records, 50);
      EXPECT_EQ(scene.dropped, 0);
      EXPECT_TRUE(scene.ignored.empty());
      EXPECT_TRUE(scene.notes.empty());
      EXPECT_EQ(scene.splats.basis, basis);
      EXPECT_EQ(scene.splats.mean, splats.mean);
      EXPECT_EQ(scene.splats.log_scale, splats.log_scale);
      EXPECT_EQ(scene.splats.opacity_logit, splats.opacity_logit);
      EXPECT_EQ(scene.splats.sh, splats.sh);
    }
}

TEST(SplatFiles, AnyEncodingTypeAndOrderIsTheSame) {
  for (const int basis : {1, 4, 9, 16})
    for (const char* encoding : {"ascii", "binary_little_endian", "binary_big_endian"})
      for (const char* type : {"float", "double"})
        for (const bool backwards : {false, true})
          for (const bool extras : {false, true}) {
            SCOPED_TRACE(std::string(encoding) + " " + type);
            const Splats splats = SomeSplats(basis);
            const SplatScene scene =
                Read(PlyOf(splats, {encoding, type, backwards, extras, ""}));
            ExpectSame(scene.splats, splats);
            EXPECT_EQ(scene.records, 20);
          }
}

TEST(SplatFiles, OtherPropertiesAndElementsAreNamed) {
  const Splats splats = SomeSplats(4);
  EXPECT_EQ(Read(PlyOf(splats, {"ascii", "float", false, true, ""})).ignored,
            (std::vector<std::string>{"property label", "property tags", "element face",
                                      "element camera"}));
  EXPECT_EQ(Read(PlyOf(splats) + "more").notes,
            std::vector<std::string>{"4 bytes after the last splat are left out"});
  EXPECT_TRUE(Read(PlyOf(splats, {.encoding = "ascii"}) + " \r\n\n").notes.empty());
}

TEST(SplatFiles, LinesMayEndAsOnWindows) {
  const Splats splats = SomeSplats(4);
  std::string file = PlyOf(splats);
  for (size_t at = 0; at < file.find("end_header") + 10;) {
    at = file.find('\n', at);
    file.insert(at, "\r");
    at += 2;
  }
  ExpectSame(Read(file).splats, splats);
}

TEST(SplatFiles, WhatIsNoSplatIsNamed) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 1\n";
  EXPECT_REGRADE_ERROR(Read(head + "property float x\nproperty float y\nproperty float z\n"
                                   "property uchar red\nend_header\n0 0 0 0\n"),
                       ExitCode::kInput,
                       "they lack scale_0, scale_1, scale_2, rot_0, rot_1, rot_2, rot_3, "
                       "opacity, f_dc_0, f_dc_1, f_dc_2");
  EXPECT_REGRADE_ERROR(
      Read("ply\nformat ascii 1.0\nelement v 1\nproperty int x\nend_header\n1"),
      ExitCode::kInput, "without an element 'vertex'");
  std::string seven = PlyOf(SomeSplats(4));
  seven.replace(seven.find("f_rest_8"), 8, "f_rest_x");
  EXPECT_REGRADE_ERROR(Read(seven), ExitCode::kInput, "they lack f_rest_8");
  seven.replace(seven.find("f_rest_x"), 8, "g_rest_x");
  EXPECT_REGRADE_ERROR(Read(seven), ExitCode::kInput, "8 properties f_rest_*");
}

TEST(SplatFiles, ACommentTellsTheFilter) {
  const Splats splats = SomeSplats(1);
  const auto says = [&splats](const std::string& comment) {
    return Read(PlyOf(splats, {.comment = comment})).antialiased;
  };
  EXPECT_TRUE(says("SplatRenderMode: mip"));
  EXPECT_TRUE(says("antialiased 1"));
  EXPECT_FALSE(says("SplatRenderMode: default"));
  EXPECT_FALSE(says("antialiased 0"));
  EXPECT_FALSE(says("not antialiased 1"));
  EXPECT_FALSE(says(""));
}

// Only the colours and a comment differ: with the old colours it is the same file.
TEST(RestyledPly, ChangesOnlyTheColours) {
  const TemporaryFolder folder;
  for (const char* encoding : {"ascii", "binary_little_endian", "binary_big_endian"})
    for (const char* type : {"float", "double"})
      for (const bool backwards : {false, true}) {
        SCOPED_TRACE(std::string(encoding) + " " + type);
        const PlyStyle style{encoding, type, backwards, true, ""};
        Splats splats = SomeSplats(9), other = splats;
        other.sh = CastSplats<float>(RandomSplats(20, 9, 6)).sh;
        const std::string before = PlyOf(splats, style), expected = PlyOf(other, style);
        WriteText(folder / "in.ply", before);
        WriteRestyled(folder / "in.ply", folder / "out.ply", ColorsOf(other.sh, 9), "a\nstyle");
        std::string after = ReadText(folder / "out.ply");
        const std::string line = "comment a\\x0astyle\n";
        const size_t at = after.find(line);
        ASSERT_EQ(at, after.find('\n', 4) + 1);
        after.erase(at, line.size());
        ExpectSame(Read(after).splats, other);
        if (std::string(encoding) != "ascii") {
          EXPECT_EQ(after, expected);
        }
      }
}

TEST(RestyledPly, HigherDegreesBecomeZeroAndDroppedSplatsStay) {
  const TemporaryFolder folder;
  Splats splats = SomeSplats(9);
  splats.mean[3 * 4] = std::nanf("");
  const std::string before = PlyOf(splats);
  WriteText(folder / "a.ply", before);
  const SplatScene scene = ReadSplats(folder / "a.ply");
  EXPECT_EQ(scene.dropped, 1);
  EXPECT_EQ(scene.first_dropped, 4);
  std::vector<float> sh(3 * 4 * 19);
  for (size_t i = 0; i < sh.size(); ++i) sh[i] = static_cast<float>(i);
  WriteRestyled(folder / "a.ply", folder / "a.ply", ColorsOf(sh, 4), "styled");
  const SplatScene back = ReadSplats(folder / "a.ply");
  EXPECT_EQ(back.splats.mean, scene.splats.mean);
  for (size_t i = 0; i < 19 * 3; ++i)
    for (size_t k = 0; k < 9; ++k)
      EXPECT_EQ(back.splats.sh[9 * i + k], k < 4 ? sh[4 * i + k] : 0);
  const std::string after = ReadText(folder / "a.ply");
  const size_t row = sizeof(float) * (3 + 27 + 1 + 3 + 4),
               from = before.size() - 16 * row;  // the row of the splat that is not drawn
  EXPECT_EQ(after.substr(after.size() - 16 * row, row), before.substr(from, row));
}

TEST(RestyledPly, SplatsThatAreKeptKeepTheirBytes) {
  const TemporaryFolder folder;
  const std::string before = PlyOf(SomeSplats(4));
  WriteText(folder / "in.ply", before);
  const std::vector<float> sh(3 * 4 * 20);
  std::vector<bool> kept(20, true);
  WriteRestyled(folder / "in.ply", folder / "out.ply", ColorsOf(sh, 4, kept), "x");
  std::string after = ReadText(folder / "out.ply");
  after.erase(after.find("comment x\n"), 10);
  EXPECT_TRUE(after == before);
  kept[3] = false;
  WriteRestyled(folder / "in.ply", folder / "out.ply", ColorsOf(sh, 4, kept), "x");
  const Splats some = ReadSplats(folder / "out.ply").splats, all = SomeSplats(4);
  for (size_t k = 0; k < sh.size(); ++k) EXPECT_EQ(some.sh[k], k / 12 == 3 ? 0 : all.sh[k]);
}

// A vertex of numbers of one digit; integers are read.
std::string ShortestText() {
  std::string file = "ply\nformat ascii 1.0\nelement vertex 1\n";
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    file += std::string("property int ") + name + "\n";
  return file + "end_header\n1 2 3 0 1 0 1 0 0 0 1 0 0 0";
}

TEST(SplatFiles, TheLastNumberMayEndTheFile) {
  EXPECT_EQ(Read(ShortestText()).splats.mean, (std::vector<float>{1, 2, 3}));
}

TEST(RestyledPly, AnotherFileIsRefusedAndNothingWritten) {
  const TemporaryFolder folder;
  const auto write = [&folder](const std::string& bytes, int64_t count) {
    WriteText(folder / "in.ply", bytes);
    const std::vector<float> sh(static_cast<size_t>(3 * count));
    WriteRestyled(folder / "in.ply", folder / "out.ply", ColorsOf(sh, 1), "");
  };
  const std::string file = PlyOf(SomeSplats(4));
  EXPECT_REGRADE_ERROR(write(file, 19), ExitCode::kInput, "no longer has the 19 splats");
  EXPECT_REGRADE_ERROR(write(file, 21), ExitCode::kInput, "no longer has the 21 splats");
  EXPECT_REGRADE_ERROR(write("NGSP", 20), ExitCode::kUsage, "only a PLY that is not");
  EXPECT_REGRADE_ERROR(write(ShortestText(), 1), ExitCode::kUsage, "its colours are integers");
  EXPECT_FALSE(std::filesystem::exists(folder / "out.ply"));
}

TEST(SplatFiles, RealPlysAreRead) {
  REGRADE_NEED_DATA("splats/fox_mcmc_60k.ply");
  const SplatScene fox = ReadSplats(testing::DataPath("splats/fox_mcmc_60k.ply"));
  EXPECT_EQ(fox.records, 60000);
  EXPECT_EQ(fox.splats.basis, 16);
  EXPECT_EQ(fox.dropped, 0);
  EXPECT_TRUE(fox.ignored.empty());
  const SplatScene bot = ReadSplats(testing::DataPath("splats/playbot_lod5_sh2.ply"));
  EXPECT_EQ(bot.splats.count(), 3000);
  EXPECT_EQ(bot.splats.basis, 9);
  const TemporaryFolder folder;
  const std::string path = testing::DataPath("splats/playbot_lod5_sh2.ply");
  WriteRestyled(path, folder / "out.ply", ColorsOf(bot.splats.sh, 9), "x");
  std::string same = ReadText(folder / "out.ply");
  same.erase(same.find("comment x\n"), 10);
  EXPECT_TRUE(same == ReadText(path));
}

}  // namespace
}  // namespace regrade
