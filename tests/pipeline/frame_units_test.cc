#include "pipeline/stages/frame_units.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "pipeline/workspace/output_names.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

std::vector<FrameSet> Sets() {
  const auto set = [](const char* prefix, size_t frames) {
    FrameSet made;
    made.prefix = prefix;
    made.cameras.resize(frames);
    return made;
  };
  return {set("", 24), set(kCommonPrefix, 48), set(kPathPrefix, 60), set(kFilmPrefix, 300)};
}

TEST(FrameUnits, HaveEachFrameOnceInOrderWhateverTheNumberOfParts) {
  const std::vector<FrameSet> sets = Sets();
  const std::vector<FrameUnit> units = UnitsOf(sets);
  ASSERT_EQ(units.size(), 1u + 1 + 2 + 7);
  EXPECT_EQ(units[3].Name(), "path_00048");
  EXPECT_EQ(units[3].Text(), "frames 48 to 59 where the film is measured");
  EXPECT_EQ(units.back().end, 300);
  for (size_t i = 1; i < units.size(); ++i)
    EXPECT_EQ(units[i].begin, units[i].set == units[i - 1].set ? units[i - 1].end : 0);
  for (const int parts : {1, 2, 3, 8, 40}) {
    std::multiset<std::string> names;
    for (int k = 1; k <= parts; ++k)
      for (const FrameUnit& unit : UnitsOfPart(units, Concat(k, "/", parts)))
        names.insert(unit.Name());
    EXPECT_EQ(names.size(), units.size()) << parts;
    EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), units.size()) << parts;
  }
}

TEST(FrameUnits, APartIsANumberOfTheirNumber) {
  const std::vector<FrameSet> sets = Sets();
  for (const char* text : {"", "3", "0/8", "9/8", "-1/8", "1/0", "1/8x", "1/8/2", "a/b",
                           "1 / 8", "1/100001", "99999999999/99999999999"})
    EXPECT_REGRADE_ERROR(UnitsOfPart(UnitsOf(sets), text), ExitCode::kUsage, "--part");
}

}  // namespace
}  // namespace regrade
