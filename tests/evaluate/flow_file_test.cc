#include "evaluate/flow_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "evaluate/flow_folder.h"
#include "kernels/base/error.h"
#include "tests/evaluate/synthetic_frames.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using namespace regrade::testing;

class FlowFile : public ::testing::Test {
 protected:
  ExitCode ReadCode() {
    const Error error = ErrorFrom([&] { ReadFlowFile(path_); });
    if (error.code() != ExitCode::kDone) {
      EXPECT_EQ(error.where(), path_);
    }
    return error.code();
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_ / "a.flo";
};

TEST_F(FlowFile, RoundTripKeepsBitsAndCountsUnknown) {
  FlowField flow = MixedFlows(17, 9, 3).first;
  flow.at(4, 5)[1] = kNan;
  flow.at(0, 0)[0] = std::numeric_limits<float>::infinity();
  flow.at(16, 8)[0] = 2e9f;
  WriteFlowFile(path_, flow);
  int64_t unknown = 0;
  const FlowField back = ReadFlowFile(path_, &unknown);
  EXPECT_EQ(unknown, 3);
  for (int y = 0; y < 9; ++y)
    for (int x = 0; x < 17; ++x)
      if ((x == 4 && y == 5) || (x == 0 && y == 0) || (x == 16 && y == 8)) {
        EXPECT_TRUE(std::isnan(back.at(x, y)[0]) && std::isnan(back.at(x, y)[1]));
      } else {
        EXPECT_EQ(std::memcmp(back.at(x, y), flow.at(x, y), 8), 0);
      }
}

TEST_F(FlowFile, HostileFilesAreRefused) {
  EXPECT_EQ(ReadCode(), ExitCode::kInput);  // no file
  WriteFlowFile(path_, ConstantFlow(5, 4, 1, 2));
  const std::string good = ReadText(path_);
  EXPECT_EQ(ReadCode(), ExitCode::kDone);
  for (size_t size : {size_t{0}, size_t{11}, size_t{12}, good.size() - 1}) {
    WriteText(path_, good.substr(0, size));
    EXPECT_EQ(ReadCode(), ExitCode::kInput) << size;
  }
  WriteText(path_, good + "x");
  EXPECT_EQ(ReadCode(), ExitCode::kInput);
  std::string bad = good;
  bad[0] ^= 1;
  WriteText(path_, bad);
  EXPECT_EQ(ReadCode(), ExitCode::kInput);
  // A header of 60000 x 60000 in a small file must not allocate 28 GB first; a negative side or
  // an overflowing product must not pass.
  for (const int32_t side : {60000, -5, 0, 0x7fffffff}) {
    bad = good;
    std::memcpy(&bad[4], &side, 4);
    std::memcpy(&bad[8], &side, 4);
    WriteText(path_, bad);
    EXPECT_EQ(ReadCode(), ExitCode::kInput) << side;
  }
}

TEST(FlowFileName, OneForEachDirection) {
  EXPECT_EQ(FlowFileName(3, 4), "00003_00004.flo");
  EXPECT_EQ(FlowFileName(4, 3), "00004_00003.flo");
}

// Whatever programs call frames: their numbers count, not their zeros.
TEST(FlowFolder, FilesAreFoundByTheirNumbers) {
  const TemporaryFolder folder;
  WriteFlowFile(folder / "flow_7_8.flo", ConstantFlow(12, 12, 1, 0));
  WriteFlowFile(folder / "00008_00007.flo", ConstantFlow(12, 12, 2, 0));
  WriteFlowFile(folder / "8_007.flo",
                ConstantFlow(12, 12, 3, 0));  // the exact name has precedence
  WriteText(folder / "readme.txt", "");
  const FlowFolder flow(folder.path(), {7, 8});
  EXPECT_EQ(flow.LeastFrame(), 7);
  EXPECT_TRUE(flow.Has(0, 1));
  EXPECT_FALSE(FlowFolder(folder.path()).Has(0, 1));
  EXPECT_EQ(flow.Read(0, 1, 12, 12).at(0, 0)[0], 1);
  EXPECT_EQ(flow.Read(1, 0, 12, 12).at(0, 0)[0], 2);
  EXPECT_REGRADE_ERROR(flow.Read(0, 1, 16, 12), ExitCode::kInput, "12 x 12 px");
  EXPECT_REGRADE_ERROR(FlowFolder(folder.path()).Read(0, 1, 12, 12), ExitCode::kInput,
                       "00000_00001.flo");
  WriteFlowFile(folder / "flow_07_08.flo", ConstantFlow(12, 12, 1, 0));
  EXPECT_REGRADE_ERROR(FlowFolder(folder.path()), ExitCode::kInput, "flow_7_8.flo");
}

}  // namespace
}  // namespace regrade
