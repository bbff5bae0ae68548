// Shares of styles in time, as they are written on a command line.
#include "pipeline/commands/mix_keys.h"

#include <gtest/gtest.h>

#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using Shares = std::vector<double>;

TEST(MixKeys, OneStyleBlendsInAndOut) {
  const MixKeys keys = ParseMixKeys("0:1:0.25", 1);
  EXPECT_EQ(keys.At(0), Shares{0});
  EXPECT_EQ(keys.At(0.25), Shares{0.5});
  EXPECT_EQ(keys.At(0.5), Shares{1});
  EXPECT_EQ(keys.At(1), Shares{0.25});
  EXPECT_FALSE(keys.IsConstant());
  EXPECT_TRUE(ParseMixKeys("0.5", 1).IsConstant());
  EXPECT_EQ(ParseMixKeys("0.5", 1).At(0.7), Shares{0.5});
}

TEST(MixKeys, SeveralStylesHaveAWeightEach) {
  const MixKeys keys = ParseMixKeys("1,0:0,1", 2);
  EXPECT_EQ(keys.At(0.25), (Shares{0.75, 0.25}));
  EXPECT_EQ(keys.At(1), (Shares{0, 1}));
  const MixKeys all = ParseMixKeys("", 2);
  ASSERT_EQ(all.points.size(), 3u);
  EXPECT_EQ(all.At(0), (Shares{0, 0}));
  EXPECT_EQ(all.At(0.5), (Shares{1, 0}));
  EXPECT_EQ(all.At(1), (Shares{0, 1}));
}

TEST(MixKeys, H49_InvalidWeightsAreRefusedByName) {
  for (const char* text : {"1.1", "-0.1", "nan", "", ":", "0:x", "0:1e999", "0x1", "1,0"})
    if (*text != 0) EXPECT_REGRADE_ERROR(ParseMixKeys(text, 1), ExitCode::kUsage, "--mix");
  EXPECT_REGRADE_ERROR(ParseMixKeys("0.7,0.7", 2), ExitCode::kUsage, "more than 1");
  EXPECT_REGRADE_ERROR(ParseMixKeys("1:0", 2), ExitCode::kUsage, "for 2 styles");
}

}  // namespace
}  // namespace regrade
