// Replays the fuzz targets of records, checkpoints, flow files and command lines.
#include "tests/fuzz/replay.h"

namespace regrade::testing {
namespace {

TEST_P(FuzzReplay, SeedsFindsAndMutants) { ReadSeedsFindsAndMutants(); }

INSTANTIATE_TEST_SUITE_P(Program, FuzzReplay, ::testing::ValuesIn(ProgramTargets()),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace regrade::testing
