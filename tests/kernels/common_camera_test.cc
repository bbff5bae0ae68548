// The common camera for photos of several sizes: its size, orientation and lens.
#include "kernels/scene/common_camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/pinhole.h"

namespace regrade {
namespace {

Camera PhotoOf(int width, int height, double focal) {
  Camera camera = testing::PinholeOf(width, height, focal);
  return camera;
}

std::string SizeOf(const Camera& camera) {
  return std::to_string(camera.width) + "x" + std::to_string(camera.height);
}

TEST(CommonCamera, OneCameraIsReturnedUnchanged) {
  Camera camera = PhotoOf(480, 360, 410.125);
  camera.fy = 433.0625;  // pixels that are not square stay so
  camera.cx = 231.5;
  const Camera common = CommonCamera({camera, camera, camera});
  EXPECT_EQ(SizeOf(common), "480x360");
  EXPECT_EQ(common.fx, camera.fx);
  EXPECT_EQ(common.fy, camera.fy);
  EXPECT_EQ(common.cx, 240);
  const std::vector<Camera> same = WithCommonIntrinsics({camera, camera});
  EXPECT_TRUE(same[1].SameIntrinsics(camera)) << "frames at the photos' poses keep their lens";
}

TEST(CommonCamera, OrientationIsThatOfMostPhotos) {
  const Camera across = PhotoOf(480, 360, 400), upright = PhotoOf(360, 480, 400),
               square = PhotoOf(480, 480, 400);
  EXPECT_EQ(SizeOf(CommonCamera({upright, across, upright})), "360x480");
  EXPECT_EQ(SizeOf(CommonCamera({upright, across, across})), "480x360");
  EXPECT_EQ(SizeOf(CommonCamera({upright, across})), "480x360") << "a tie is landscape";
  // A square counts as landscape: two of four make a tie, and 1 is the lower aspect.
  EXPECT_EQ(SizeOf(CommonCamera({upright, upright, square, across})), "480x480");
}

TEST(CommonCamera, AspectIsTheMedianAndThePhotoTheFirstOfIt) {
  const Camera panorama = PhotoOf(480, 120, 400), wide = PhotoOf(480, 270, 400),
               common = PhotoOf(480, 360, 400), small = PhotoOf(240, 180, 200);
  EXPECT_EQ(SizeOf(CommonCamera({panorama, common, wide})), "480x270");
  EXPECT_EQ(SizeOf(CommonCamera({wide, common, panorama})), "480x270");
  EXPECT_EQ(SizeOf(CommonCamera({panorama, small, common, wide, small})), "240x180");
  EXPECT_EQ(SizeOf(CommonCamera({panorama, common, small, wide, small})), "480x360");
}

// A portrait photo among landscape ones shows the same circle: focal lengths are not scaled by
// each side's ratio.
TEST(CommonCamera, ACircleStaysACircle) {
  const Camera across = PhotoOf(480, 360, 400), upright = PhotoOf(360, 480, 400);
  for (const std::vector<Camera>& photos :
       {std::vector<Camera>{upright, across, across}, {across, upright, upright}}) {
    const Camera common = CommonCamera(photos);
    EXPECT_EQ(common.fx, common.fy);
    EXPECT_NEAR(common.fx, 400, 1e-9);
  }
  // A ball straight ahead has the same width and height.
  const Camera common = CommonCamera({upright, across, across});
  double left, top, right, bottom, middle;
  ASSERT_TRUE(common.Project({-0.5, 0, 2}, &left, &middle));
  ASSERT_TRUE(common.Project({0.5, 0, 2}, &right, &middle));
  ASSERT_TRUE(common.Project({0, -0.5, 2}, &middle, &top));
  ASSERT_TRUE(common.Project({0, 0.5, 2}, &middle, &bottom));
  EXPECT_NEAR(right - left, bottom - top, 1e-9);
}

TEST(CommonCamera, FocalLengthIsTheMedianAndPixelsAreSquare) {
  const Camera a = PhotoOf(480, 360, 380), b = PhotoOf(360, 480, 400),
               c = PhotoOf(480, 320, 900);
  EXPECT_NEAR(CommonCamera({a, b, c}).fx, 400, 1e-9);
  // The same lens on a photo of half the size: its focal length is scaled accordingly.
  EXPECT_NEAR(CommonCamera({a, PhotoOf(240, 180, 200), c}).fx, 400, 1e-9);
  // Rounding of sizes changes fx / fy by a part in a thousand, which is not a property of a
  // lens.
  Camera rounded = a;
  rounded.fy *= 1.002;
  const Camera square = CommonCamera({rounded, rounded, b});
  EXPECT_EQ(square.fx, square.fy);
  Camera anamorphic = a;
  anamorphic.fy *= 1.2;
  const Camera stretched = CommonCamera({anamorphic, anamorphic, b});
  EXPECT_NEAR(stretched.fy / stretched.fx, 1.2, 1e-9);
}

TEST(CommonCamera, PosesStayAndTheOrderDoesNotMatter) {
  std::vector<Camera> photos = {PhotoOf(480, 360, 380), PhotoOf(360, 480, 410),
                                PhotoOf(480, 270, 395), PhotoOf(480, 300, 405)};
  for (size_t i = 0; i < photos.size(); ++i)
    photos[i].camera_from_world.translation = {static_cast<double>(i), 0, 1};
  const std::vector<Camera> common = WithCommonIntrinsics(photos);
  for (size_t i = 0; i < photos.size(); ++i) {
    EXPECT_TRUE(common[i].SameIntrinsics(common[0]));
    EXPECT_EQ(common[i].camera_from_world.translation.x, static_cast<double>(i));
  }
  std::reverse(photos.begin(), photos.end());
  EXPECT_TRUE(CommonCamera(photos).SameIntrinsics(common[0]));
}

}  // namespace
}  // namespace regrade
