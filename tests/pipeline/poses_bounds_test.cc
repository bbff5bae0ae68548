// LLFF's camera file: what it says, and files that are damaged.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>

#include "pipeline/capture/llff_poses.h"
#include "pipeline/files/npy_header.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

// Camera at (1, 2, 3), not turned against LLFF's axes: right x, up y, backward z.
std::vector<double> Row() {
  // columns: down, right, backward, position, size
  return {0,   1, 0, 1, 480,  //
          -1,  0, 0, 2, 640,  //
          0,   0, 1, 3, 500,  //
          1.5, 20};
}

class PosesBounds : public ::testing::Test {
 protected:
  std::string Write(const std::vector<double>& values, std::vector<int64_t> shape) {
    const std::string path = folder_.path() + "/poses_bounds.npy";
    std::string bytes = MakeNpyHeader(ArrayType::kF64, shape);
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  testing::TemporaryFolder folder_;
};

TEST_F(PosesBounds, AxesSizesAndBounds) {
  std::vector<double> two = Row(), second = Row();
  second[15] = 0.7;
  two.insert(two.end(), second.begin(), second.end());
  const LlffPoses poses = ReadPosesBounds(Write(two, {2, 17}));
  ASSERT_EQ(poses.cameras.size(), 2u);
  EXPECT_EQ(poses.nearest, 0.7);
  EXPECT_EQ(poses.farthest, 20);
  const Camera& camera = poses.cameras[0];
  EXPECT_EQ(camera.width, 640);
  EXPECT_EQ(camera.height, 480);
  EXPECT_EQ(camera.fx, 500);
  EXPECT_NEAR(Norm(camera.Center() - Vec3d{1, 2, 3}), 0, 1e-12);
  EXPECT_NEAR(Norm(camera.Forward() - Vec3d{0, 0, -1}), 0, 1e-12);
  EXPECT_NEAR(Norm(camera.Up() - Vec3d{0, 1, 0}), 0, 1e-12);
}

TEST_F(PosesBounds, F64_DamageIsRefused) {
  EXPECT_REGRADE_ERROR(ReadPosesBounds(Write(Row(), {17})), ExitCode::kInput, "17 doubles");
  EXPECT_REGRADE_ERROR(ReadPosesBounds(Write(Row(), {2, 17})), ExitCode::kInput,
                       "poses_bounds");
  for (const auto& [at, value] :
       std::vector<std::pair<size_t, double>>{{3, std::numeric_limits<double>::quiet_NaN()},
                                              {1, 0.5},
                                              {9, -3},
                                              {14, 0},
                                              {14, 1e9},   // H134: no lens has it
                                              {3, 1e300},  // at infinity
                                              {15, -1},
                                              {15, 30}}) {
    std::vector<double> row = Row();
    row[at] = value;
    EXPECT_REGRADE_ERROR(ReadPosesBounds(Write(row, {1, 17})), ExitCode::kInput, "pose 0");
  }
}

}  // namespace
}  // namespace regrade
