// The readers of files, under mutants that are the same everywhere.
#include "tests/fuzz/replay.h"

namespace regrade::testing {
namespace {

TEST_P(FuzzReplay, SeedsFindsAndMutants) { ReadSeedsFindsAndMutants(); }

INSTANTIATE_TEST_SUITE_P(Readers, FuzzReplay, ::testing::ValuesIn(ReaderTargets()),
                         [](const auto& info) { return std::string(info.param.name); });

// A reader that guarantees too much is seen, and so is one that throws what is no Error.
TEST(FuzzReplayItself, AFindIsAFind) {
  EXPECT_THROW(Accepts([] { FuzzRequire(false, "a guarantee"); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw Error(ExitCode::kBug, "odd"); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw Error(ExitCode::kInput, ""); }), BrokenPremise);
  EXPECT_THROW(Accepts([] { throw std::bad_alloc(); }), std::bad_alloc);
  EXPECT_FALSE(Accepts([] { throw Error(ExitCode::kInput, "bad"); }));
}

}  // namespace
}  // namespace regrade::testing
