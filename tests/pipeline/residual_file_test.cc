// residual.npz: what comes back, and what is refused.
#include "pipeline/fields/residual_file.h"

#include <gtest/gtest.h>

#include <limits>

#include "pipeline/files/npz_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

TEST(ResidualFile, RoundTripKeepsWhatCanBeSeen) {
  const TemporaryFolder folder;
  const VoxelResidual residual{{{0.25f, -0.5f, 0.0005f}, {0, 1.5f, -0.002f}},
                               {{1, 0.5f, 0}, {0.25f, 1, 1}}};
  WriteResidualFile(folder / "a.npz", residual);
  const VoxelResidual back = ReadResidualFile(folder / "a.npz", {.of = 2});
  EXPECT_EQ(back.color[0], (Vec3f{0.25f, -0.5f, 0}));  // less than a quarter of a step is 0
  EXPECT_EQ(back.color[1], residual.color[1]);
  EXPECT_EQ(back.view_scale, residual.view_scale);
  WriteResidualFile(folder / "b.npz", {residual.color, {}});
  EXPECT_TRUE(ReadResidualFile(folder / "b.npz", {.of = 2}).view_scale.empty());
  const KeptRecords second{.of = 2, .kept = {1}, .all = false};
  EXPECT_EQ(ReadResidualFile(folder / "a.npz", second).color, std::vector{back.color[1]});
}

TEST(ResidualFile, OthersAreRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "residual.npz";
  const auto write = [&](float color, float scale, int32_t version) {
    const float colors[6] = {color}, scales[6] = {scale};
    NpzWriter file;
    file.Add("residual", {2, 3}, colors);
    file.Add("view_scale", {2, 3}, scales);
    file.AddScalar<int32_t>("regrade_version", version);
    file.WriteTo(path);
  };
  write(0.5f, 0.5f, 1);
  EXPECT_NO_THROW(ReadResidualFile(path, {.of = 2}));
  EXPECT_REGRADE_ERROR(ReadResidualFile(path, {.of = 3}), ExitCode::kInput, "residual");
  const std::string whole = ReadText(path);
  WriteText(path, whole.substr(0, whole.size() / 2));
  EXPECT_REGRADE_ERROR(ReadResidualFile(path, {.of = 2}), ExitCode::kInput, "");
  write(std::numeric_limits<float>::quiet_NaN(), 0.5f, 1);
  EXPECT_REGRADE_ERROR(ReadResidualFile(path, {.of = 2}), ExitCode::kInput, "is none");
  write(0.5f, 1.5f, 1);
  EXPECT_REGRADE_ERROR(ReadResidualFile(path, {.of = 2}), ExitCode::kInput, "view_scale");
  write(0.5f, 0.5f, 2);
  EXPECT_REGRADE_ERROR(ReadResidualFile(path, {.of = 2}), ExitCode::kInput, "");
}

}  // namespace
}  // namespace regrade
