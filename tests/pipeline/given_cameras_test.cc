// Cameras of NSVF's and DTU's layouts: what they say, and files that are damaged.
#include <gtest/gtest.h>

#include <cmath>

#include "kernels/base/random.h"
#include "pipeline/capture/dtu_cameras.h"
#include "pipeline/capture/nsvf_cameras.h"
#include "pipeline/files/npz_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

class GivenCameras : public ::testing::Test {
 protected:
  std::string Write(const std::string& text) {
    WriteText(folder_ / "numbers.txt", text);
    return folder_ / "numbers.txt";
  }
  Camera Intrinsics(const std::string& text) { return ReadNsvfIntrinsics(Write(text)); }
  TemporaryFolder folder_;
};

TEST_F(GivenCameras, NumbersOfATextFile) {
  const auto lines = ReadNumberFile(Write("1 -2.5e3\t+4\r\n\n  ,0.5,\n"));
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0], (std::vector<double>{1, -2500, 4}));
  EXPECT_EQ(lines[1], std::vector<double>{0.5});
  EXPECT_EQ(ReadNumberFile(Write("\xef\xbb\xbf+0.5 -1"))[0], (std::vector<double>{0.5, -1}));
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write("+-1")), ExitCode::kInput, "not a number");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write("1\n2 x")), ExitCode::kInput,
                       "'x' is not a number");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write("1\n2 nan")), ExitCode::kInput, "numbers.txt:2");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write("1e999")), ExitCode::kInput, "not a number");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write("1.5.2")), ExitCode::kInput, "not a number");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write(" \n")), ExitCode::kInput, "no numbers");
  EXPECT_REGRADE_ERROR(ReadNumberFile(folder_ / "none"), ExitCode::kInput, "none");
  EXPECT_REGRADE_ERROR(ReadNumberFile(Write(std::string(70000, '1'))), ExitCode::kInput,
                       "numbers.txt");
}

TEST_F(GivenCameras, IntrinsicsInEachForm) {
  for (const char* text :
       {"500 0 320 0\n0 510 240 0\n0 0 1 0\n0 0 0 1\n", "500 0 320\n0 510 240\n0 0 1",
        "500 0 320 0 0 510 240 0 0 0 1 0 0 0 0 1", "500 0 320 0\n0 510 240 0\n0 0 1 0"}) {
    const Camera camera = Intrinsics(text);
    EXPECT_EQ(camera.fx, 500) << text;
    EXPECT_EQ(camera.fy, 510) << text;
    EXPECT_EQ(camera.cx, 320) << text;
    EXPECT_EQ(camera.cy, 240) << text;
  }
  // NSVF's own: focal length and principal point, then near bound, scale and size.
  const Camera own = Intrinsics("875.0 400.0 401.0 0.\n0. 0. 0.\n0.\n1.\n800 800\n");
  EXPECT_EQ(own.fx, 875);
  EXPECT_EQ(own.fy, 875);
  EXPECT_EQ(own.cx, 400);
  EXPECT_EQ(own.cy, 401);
  EXPECT_REGRADE_ERROR(Intrinsics("500 3 320\n0 510 240\n0 0 1"), ExitCode::kInput, "skewed");
  EXPECT_REGRADE_ERROR(Intrinsics("500 0"), ExitCode::kInput, "neither a matrix");
  EXPECT_REGRADE_ERROR(Intrinsics("-500 320 240"), ExitCode::kInput, "not positive");
  EXPECT_REGRADE_ERROR(Intrinsics("1e300 320 240"), ExitCode::kInput, "beyond all pictures");
}

TEST_F(GivenCameras, PosesLeadFromTheCameraToTheWorld) {
  // A camera at (1, 2, 3) that looks along x: right is -y, down is -z.
  const std::string rows = "0 0 1 1\n-1 0 0 2\n0 -1 0 3\n";
  for (const std::string& text : {rows, rows + "0 0 0 1\n"}) {
    Camera camera;
    camera.camera_from_world = ReadNsvfPose(Write(text));
    EXPECT_NEAR(Norm(camera.Center() - Vec3d{1, 2, 3}), 0, 1e-12);
    EXPECT_NEAR(Norm(camera.Forward() - Vec3d{1, 0, 0}), 0, 1e-12);
    EXPECT_NEAR(Norm(camera.Up() - Vec3d{0, 0, 1}), 0, 1e-12);
  }
  EXPECT_REGRADE_ERROR(ReadNsvfPose(Write("1 0 0\n0 1 0\n0 0 1")), ExitCode::kInput,
                       "3 x 4 or 4 x 4");
  EXPECT_REGRADE_ERROR(ReadNsvfPose(Write("1 0 0 0\n0 2 0 0\n0 0 1 0")), ExitCode::kInput,
                       "not a rotation");
  EXPECT_REGRADE_ERROR(ReadNsvfPose(Write("1 0 0 0\n0 1 0 0\n0 0 -1 0")), ExitCode::kInput,
                       "not a rotation");  // a reflection
}

TEST_F(GivenCameras, ABoxHasTwoCorners) {
  const WorldBox box = ReadNsvfBox(Write("-1 -2 -3 4 5 6 0.4\n"));
  EXPECT_EQ(Norm(box.low - Vec3d{-1, -2, -3}), 0);
  EXPECT_EQ(Norm(box.high - Vec3d{4, 5, 6}), 0);
  EXPECT_REGRADE_ERROR(ReadNsvfBox(Write("-1 -2 -3 4 5")), ExitCode::kInput, "two corners");
  EXPECT_REGRADE_ERROR(ReadNsvfBox(Write("-1 -2 -3 4 -2 6")), ExitCode::kInput, "no volume");
  EXPECT_REGRADE_ERROR(ReadNsvfBox(Write("-1 -2 -3 4 5 1e300")), ExitCode::kInput,
                       "beyond all scenes");
}

TEST(NsvfSplit, PrefixesSayWhatAPictureIsFor) {
  const NsvfSplit split = SplitNsvf({"0_a.png", "0_b.png", "1_c.png", "2_d.png", "e.png"});
  EXPECT_EQ(split.only, (std::set<std::string>{"0_a.png", "0_b.png", "2_d.png"}));
  EXPECT_EQ(split.test, std::set<std::string>{"2_d.png"});
  const NsvfSplit validation = SplitNsvf({"0_a.png", "1_c.png"});
  EXPECT_EQ(validation.test, std::set<std::string>{"1_c.png"});
  EXPECT_EQ(validation.only.size(), 2u);
  for (const auto& names :
       {std::vector<std::string>{"a.png", "b.png"}, {"0_a.png"}, {"2_d.png"}}) {
    EXPECT_TRUE(SplitNsvf(names).only.empty());
    EXPECT_TRUE(SplitNsvf(names).test.empty());
  }
}

// K [R | t] of a known camera, times a factor of either sign.
std::vector<double> ProjectionOf(const Camera& camera, double factor) {
  const double k[3][3] = {{camera.fx, 0, camera.cx}, {0, camera.fy, camera.cy}, {0, 0, 1}};
  std::vector<double> projection;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j) {
      double sum = 0;
      for (int a = 0; a < 3; ++a)
        sum += k[i][a] * (j < 3 ? camera.camera_from_world.rotation(a, j)
                                : camera.camera_from_world.translation[a]);
      projection.push_back(factor * sum);
    }
  return projection;
}

Camera SomeCamera(uint64_t seed) {
  const auto draw = [seed](uint64_t i) { return 2 * RandomDouble(seed, 3, i) - 1; };
  Camera camera;
  camera.fx = 2892.3;
  camera.fy = 2883.2;
  camera.cx = 823.2 + 50 * draw(0);
  camera.cy = 619.1;
  const Vec3d forward = Normalized(Vec3d{draw(1), draw(2), draw(3)});
  const Vec3d right = Normalized(Cross(forward, Vec3d{draw(4), draw(5), draw(6)}));
  camera.camera_from_world.rotation.row[0] = right;
  camera.camera_from_world.rotation.row[1] = Cross(forward, right);
  camera.camera_from_world.rotation.row[2] = forward;
  camera.camera_from_world.translation = {300 * draw(7), 300 * draw(8), 600 + 100 * draw(9)};
  return camera;
}

void ExpectSame(const Camera& a, const Camera& b, double lengths) {
  EXPECT_NEAR(a.fx, b.fx, 1e-8);
  EXPECT_NEAR(a.fy, b.fy, 1e-8);
  EXPECT_NEAR(a.cx, b.cx, 1e-8);
  EXPECT_NEAR(a.cy, b.cy, 1e-8);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(Norm(a.camera_from_world.rotation.row[i] - b.camera_from_world.rotation.row[i]),
                0, 1e-11);
  EXPECT_NEAR(Norm(a.camera_from_world.translation - b.camera_from_world.translation), 0,
              1e-9 * lengths);
}

TEST(DtuCameras, AProjectionIsTakenApart) {
  for (uint64_t seed = 0; seed < 50; ++seed)
    for (const double factor : {1.0, -1.0, 1e-4, 37.0}) {
      const Camera camera = SomeCamera(seed);
      ExpectSame(CameraOfProjection(ProjectionOf(camera, factor).data(), "p"), camera, 1000);
    }
  std::vector<double> flat = ProjectionOf(SomeCamera(1), 1);
  for (int j = 0; j < 4; ++j) flat[static_cast<size_t>(8 + j)] = flat[static_cast<size_t>(j)];
  EXPECT_REGRADE_ERROR(CameraOfProjection(flat.data(), "p"), ExitCode::kInput, "no projection");
  const std::vector<double> none(12, 0.0);
  EXPECT_REGRADE_ERROR(CameraOfProjection(none.data(), "p"), ExitCode::kInput, "no projection");
  std::vector<double> skewed = ProjectionOf(SomeCamera(1), 1);
  for (int j = 0; j < 4; ++j)
    skewed[static_cast<size_t>(j)] += 0.01 * skewed[static_cast<size_t>(4 + j)];
  EXPECT_REGRADE_ERROR(CameraOfProjection(skewed.data(), "p"), ExitCode::kInput, "skewed");
}

TEST(DtuCameras, TheUnitSpheresFrame) {
  const TemporaryFolder folder;
  const std::string path = folder / "cameras.npz";
  const Camera camera = SomeCamera(7);
  std::vector<double> world = ProjectionOf(camera, 1);
  world.insert(world.end(), {0, 0, 0, 1});
  std::vector<float> third(world.begin(), world.end());
  const double r = 250;
  const std::vector<double> scale{r, 0, 0, 10, 0, r, 0, 20, 0, 0, r, 600, 0, 0, 0, 1};
  {
    NpzWriter writer;
    writer.Add("world_mat_0", {4, 4}, world.data());
    writer.Add("scale_mat_0", {4, 4}, scale.data());
    writer.Add("world_mat_inv_0", {4, 4}, world.data());
    writer.WriteTo(path);
  }
  const std::map<int, Camera> cameras = ReadDtuCameras(path);
  ASSERT_EQ(cameras.size(), 1u);
  Camera expected = camera;  // its centre in the frame of the sphere
  const Vec3d center = (camera.Center() - Vec3d{10, 20, 600}) * (1 / r);
  expected.camera_from_world.translation = -(camera.camera_from_world.rotation * center);
  ExpectSame(cameras.at(0), expected, 10);
  {  // one of them has no sphere: the world it is; single precision
    NpzWriter writer;
    writer.Add("world_mat_0", {4, 4}, world.data());
    writer.Add("scale_mat_0", {4, 4}, scale.data());
    writer.Add("world_mat_12", {4, 4}, third.data());
    writer.WriteTo(path);
  }
  const std::map<int, Camera> unscaled = ReadDtuCameras(path);
  ASSERT_EQ(unscaled.size(), 2u);
  ExpectSame(unscaled.at(0), camera, 1000);
  EXPECT_NEAR(Norm(unscaled.at(12).Center() - camera.Center()), 0, 0.05);
}

TEST(DtuCameras, DamageIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder / "cameras.npz";
  const auto read = [&](const std::string& name, const std::vector<int64_t>& shape,
                        std::vector<double> values) {
    NpzWriter writer;
    writer.Add(name, shape, values.data());
    writer.WriteTo(path);
    return ReadDtuCameras(path);
  };
  std::vector<double> good = ProjectionOf(SomeCamera(1), 1);
  EXPECT_EQ(read("world_mat_0", {3, 4}, good).size(), 1u);
  EXPECT_REGRADE_ERROR(read("camera_0", {3, 4}, good), ExitCode::kInput, "no world_mat_0");
  EXPECT_REGRADE_ERROR(read("world_mat_0", {4, 3}, good), ExitCode::kInput, "4 x 4");
  good[5] = std::nan("");
  EXPECT_REGRADE_ERROR(read("world_mat_0", {3, 4}, good), ExitCode::kInput, "not finite");
}

}  // namespace
}  // namespace regrade
