// Replays the fuzz targets of the file readers.
#include "tests/fuzz/replay.h"

namespace regrade::testing {
namespace {

TEST_P(FuzzReplay, SeedsFindsAndMutants) { ReadSeedsFindsAndMutants(); }

INSTANTIATE_TEST_SUITE_P(Readers, FuzzReplay, ::testing::ValuesIn(ReaderTargets()),
                         [](const auto& info) { return std::string(info.param.name); });

// The replay detects a broken guarantee and an exception that is no Error.
TEST(FuzzReplayItself, AFindIsAFind) {
  EXPECT_THROW(Accepts([] { FuzzRequire(false, "a guarantee"); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw Error(ExitCode::kBug, "odd"); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw Error(ExitCode::kInput, ""); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw std::bad_alloc(); }), std::bad_alloc);
  EXPECT_FALSE(Accepts([] { throw Error(ExitCode::kInput, "bad"); }));
}

}  // namespace
}  // namespace regrade::testing
