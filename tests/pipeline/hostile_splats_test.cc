// Files of splats that are damaged or made to do harm: refused with a reason, or cleaned.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "kernels/splats/covariance.h"
#include "pipeline/fields/colored_splat.h"
#include "pipeline/fields/read_splats.h"
#include "tests/support/expect_error.h"
#include "tests/support/peak_memory.h"
#include "tests/support/small_splats.h"
#include "tests/support/splat_bytes.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::CastSplats;
using testing::PlyOf;
using testing::RandomSplats;
using testing::TemporaryFolder;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(),
                kInfinity = std::numeric_limits<float>::infinity();

SplatScene Read(const std::string& bytes, uint64_t budget = uint64_t{1} << 32) {
  const TemporaryFolder folder;
  testing::WriteText(folder / "a.ply", bytes);
  return ReadSplats(folder / "a.ply", budget);
}

Splats SomeSplats(int64_t count = 6) { return CastSplats<float>(RandomSplats(count, 4, 5)); }

// Puts `value` into one number of splat 2 and reads the file.
SplatScene With(std::vector<float> Splats::*array, size_t place, float value,
                const char* type = "float") {
  Splats splats = SomeSplats();
  const size_t width = (splats.*array).size() / 6;
  (splats.*array)[2 * width + place] = value;
  return Read(PlyOf(splats, {.type = type}));
}

TEST(HostileSplats, WhatCannotBeDrawnIsDroppedAndCounted) {
  for (const float value : {kNan, kInfinity, -kInfinity, 3e38f, -3e38f})
    for (const auto array : {&Splats::mean, &Splats::sh}) {
      const SplatScene scene = With(array, 1, value);
      EXPECT_EQ(scene.records, 6);
      EXPECT_EQ(scene.dropped, 1) << value;
      EXPECT_EQ(scene.first_dropped, 2);
      EXPECT_EQ(scene.splats.count(), 5);
    }
  for (const float value : {kNan, kInfinity, 1e30f, 51.0f})
    EXPECT_EQ(With(&Splats::log_scale, 0, value).dropped, 1) << value;
  for (const float value : {kNan, kInfinity, -kInfinity})
    EXPECT_EQ(With(&Splats::quaternion, 3, value).dropped, 1) << value;
  EXPECT_EQ(With(&Splats::opacity_logit, 0, kNan).dropped, 1);
}

TEST(HostileSplats, WhatHasALimitIsLimited) {
  for (const float value : {1000.0f, -1000.0f, kInfinity, -kInfinity}) {
    const SplatScene scene = With(&Splats::opacity_logit, 0, value, "double");
    EXPECT_EQ(scene.dropped, 0);
    EXPECT_EQ(scene.splats.opacity_logit[2], std::copysign(kMostLogit, value));
  }
  for (const float value : {-kInfinity, -1e30f}) {
    const SplatScene scene = With(&Splats::log_scale, 1, value);
    EXPECT_EQ(scene.dropped, 0);
    EXPECT_EQ(scene.splats.log_scale[7], -static_cast<float>(kMaxLogScale));
  }
  Splats splats = SomeSplats();
  for (const float tiny : {0.0f, 1e-35f, 1e-45f}) {
    std::fill_n(splats.quaternion.begin() + 8, 4, tiny);
    const SplatScene scene = Read(PlyOf(splats));
    EXPECT_EQ(scene.dropped, 0);
    EXPECT_EQ(std::vector<float>(scene.splats.quaternion.begin() + 8,
                                 scene.splats.quaternion.begin() + 12),
              (std::vector<float>{1, 0, 0, 0}));
  }
}

// log(0) and log(1 / 0) are not.
TEST(HostileSplats, BytesOfOpacityHaveFiniteLogits) {
  EXPECT_NEAR(LogitOfByte(51), std::log(0.25), 1e-6);
  EXPECT_NEAR(LogitOfByte(255), std::log(1019.0), 1e-5);
  EXPECT_NEAR(LogitOfByte(0), -std::log(1019.0), 1e-5);
  for (int byte = 1; byte < 256; ++byte) EXPECT_GT(LogitOfByte(byte), LogitOfByte(byte - 1));
}

// A double that no float has is infinite.
TEST(HostileSplats, DoublesBeyondFloatsAreDropped) {
  std::string file = PlyOf(SomeSplats(), {.type = "double"});
  const size_t first = file.find("end_header\n") + 11;
  file.replace(first, 8, testing::LittleEndian(1e300));
  EXPECT_EQ(Read(file).first_dropped, 0);
}

TEST(HostileSplats, NoneIsRefused) {
  EXPECT_REGRADE_ERROR(Read(PlyOf(SomeSplats(0))), ExitCode::kInput, "there are no splats");
  Splats splats = SomeSplats();
  std::ranges::fill(splats.mean, kNan);
  EXPECT_REGRADE_ERROR(Read(PlyOf(splats)), ExitCode::kInput, "none of its 6 splats");
}

// Nothing is allocated for a count before it has been compared with the file.
TEST(HostileSplats, LyingCountsTakeNoMemory) {
  testing::ResetPeakMemory();
  const int64_t before = testing::PeakMemory();
  for (const char* encoding : {"ascii", "binary_little_endian", "binary_big_endian"})
    for (const char* count : {"7", "50000000", "9223372036854775808", "18446744073709551615"}) {
      std::string file = PlyOf(SomeSplats(), {.encoding = encoding});
      file.replace(file.find("vertex 6") + 7, 1, count);
      EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput,
                           strlen(count) > 1 ? "fit into the file" : "header says 7");
      // Of another element, with a property and without one.
      for (const char* property : {"property list uchar int a\n", "property char a\n"}) {
        file = PlyOf(SomeSplats(), {.encoding = encoding});
        file.insert(file.find("element"),
                    std::string("element face ") + count + "00\n" + property);
        EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "");
      }
      file = PlyOf(SomeSplats(), {.encoding = encoding});
      file.insert(file.find("element"), std::string("element empty ") + count + "\n");
      EXPECT_EQ(Read(file).splats.count(), 6);
    }
  EXPECT_LT(testing::PeakMemory() - before, 32 << 20);
}

TEST(HostileSplats, AListOfNegativeLengthIsRefused) {
  std::string file = PlyOf(SomeSplats(), {.extras = true});
  file.replace(file.find("list uchar uchar"), 16, "list char uchar");
  file[file.find("end_header\n") + 11] = '\xff';
  EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "negative length");
}

TEST(HostileSplats, CountsThatAreNoNumbersAreRefused) {
  for (const char* count : {"-1", "1e3", "0x10", "99999999999999999999", "six", ""}) {
    std::string file = PlyOf(SomeSplats());
    file.replace(file.find("vertex 6") + 7, 1, count);
    EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput, "without a name and a count");
  }
}

TEST(HostileSplats, APartOfAFileIsRefused) {
  for (const char* encoding : {"ascii", "binary_little_endian"})
    for (const bool extras : {false, true}) {
      const std::string file = PlyOf(SomeSplats(2), {.encoding = encoding, .extras = extras});
      // A text may end within its last number, and behind the last splat there is at most an
      // element that is not read.
      for (size_t size = 0; size + 16 < file.size(); size += 7)
        EXPECT_REGRADE_ERROR(Read(file.substr(0, size)), ExitCode::kInput, "");
    }
}

TEST(HostileSplats, HeadersThatAreNoneAreRefused) {
  const std::string head = "ply\nformat ascii 1.0\n";
  for (const auto& [bytes, why] :
       {std::pair<std::string, const char*>{"ply\n" + std::string(3 << 20, 'c'), "no end"},
        {head + "element vertex 1\nproperty float x\n", "no end"},
        {"ply\nend_header\n", "does not name its encoding"},
        {"ply\nformat utf8 1.0\nend_header\n", "'utf8' is not an encoding"},
        {head + "property float x\nend_header\n", "a property without an element"},
        {head + "element vertex 1\nproperty half x\nend_header\n", "'half' is not a type"},
        {head + "element vertex 1\nproperty list float int x\nend_header\n", "is a fraction"},
        {head + "element v 1\nproperty int x\nproperty int x\nend_header\n", "appears twice"},
        {head + "element v 1\nelement v 1\nend_header\n", "appears twice"},
        {head + "\x1b[2Jbad\nend_header\n", "\\x1b[2Jbad"},
        {head + "end_header\n", "without an element 'vertex'"}})
    EXPECT_REGRADE_ERROR(Read(bytes), ExitCode::kInput, why);
}

TEST(HostileSplats, WordsThatAreNoNumbersAreNamed) {
  for (const char* word : {"x", "1e999", "0x1p3", "1,5", "--1"}) {
    std::string file = PlyOf(SomeSplats(), {.encoding = "ascii"});
    const size_t first = file.find("end_header\n") + 11;
    file.replace(first, file.find(' ', first) - first, word);
    EXPECT_REGRADE_ERROR(Read(file), ExitCode::kInput,
                         std::string("row 0, property 'x': '") + word + "' is not a number");
  }
}

TEST(HostileSplats, MoreThanTheBudgetIsRefused) {
  const std::string file = PlyOf(SomeSplats(1000));
  EXPECT_REGRADE_ERROR(Read(file, file.size() - 1), ExitCode::kInput, "more than the limit");
  EXPECT_REGRADE_ERROR(Read(file, file.size() + 50000), ExitCode::kInput, "1000 splats need");
  EXPECT_EQ(Read(file, file.size() + 1000 * 23 * 4).splats.count(), 1000);
}

}  // namespace
}  // namespace regrade
