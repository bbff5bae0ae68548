// Shares of views whose surfaces few photos see, against counts by hand.
#include "evaluate/seen_by_few.h"

#include <gtest/gtest.h>

#include <functional>

#include "tests/support/pinhole.h"

namespace regrade {
namespace {

constexpr int kSeenW = 160, kSeenH = 80;
constexpr double kWall = 4;

// Looks along z from (x, 0, z); the picture is 4 x 2 world units at the wall.
Camera CameraAt(double x, double z = 0) {
  Camera camera = testing::PinholeOf(kSeenW, kSeenH, kSeenW);
  camera.camera_from_world.translation = {-x, 0, -z};
  return camera;
}

SampledView WallFrom(double x, const Image& kept = {}) {
  Image depth(kSeenW, kSeenH, 1);
  for (float& value : depth.pixels) value = kWall;
  return SampleView(CameraAt(x), depth, kept);
}

TEST(SeenByFew, H173_ASideThatTwoPhotosSeeIsCounted) {
  // The last two photos are moved by half a picture, so only its right half is in three.
  const std::vector<SampledView> photos = {WallFrom(0), WallFrom(2), WallFrom(2)};
  EXPECT_NEAR(SeenByFew(photos[0], photos, 0).value(), 0.5, 1e-12);
  EXPECT_EQ(SeenByFew(photos[0], {photos[0], photos[0], photos[0]}, 0).value(), 0);
  EXPECT_EQ(SeenByFew(photos[0], {photos[0], photos[0]}, 0).value(), 1);
  EXPECT_EQ(SeenByFew(photos[0], {}, 0).value(), 1);
}

TEST(SeenByFew, H173_WhatIsHiddenInAPhotoIsNotSeenByIt) {
  // An object before the left quarter of the third photo.
  Image depth(kSeenW, kSeenH, 1);
  for (int y = 0; y < kSeenH; ++y)
    for (int x = 0; x < kSeenW; ++x) *depth.at(x, y) = x < kSeenW / 4 ? 1 : kWall;
  const SampledView wall = WallFrom(0), hidden = SampleView(CameraAt(0), depth);
  EXPECT_NEAR(SeenByFew(wall, {wall, wall, hidden}, 0).value(), 0.25, 1e-12);
  // Nothing is hidden where a photo shows no surface.
  const SampledView empty = SampleView(CameraAt(0), Image(kSeenW, kSeenH, 1));
  EXPECT_EQ(SeenByFew(wall, {wall, wall, empty}, 0).value(), 0);
}

TEST(SeenByFew, H173_WhatIsMaskedInAPhotoIsNotSeenByIt) {
  Image kept(kSeenW, kSeenH, 1);
  for (int y = 0; y < kSeenH; ++y)
    for (int x = kSeenW / 2; x < kSeenW; ++x) *kept.at(x, y) = 1;
  const SampledView wall = WallFrom(0);
  EXPECT_NEAR(SeenByFew(wall, {wall, wall, WallFrom(0, kept)}, 0).value(), 0.5, 1e-12);
}

TEST(SeenByFew, H173_BehindAPhotoOrNearerThanItsLimitIsNotSeen) {
  const SampledView wall = WallFrom(0);
  Image any(kSeenW, kSeenH, 1);
  const SampledView beyond = SampleView(CameraAt(0, kWall + 1), any);
  EXPECT_EQ(SeenByFew(wall, {wall, wall, beyond}, 0).value(), 1);
  EXPECT_EQ(SeenByFew(wall, {wall, wall, wall}, kWall - 0.01).value(), 0);
  EXPECT_EQ(SeenByFew(wall, {wall, wall, wall}, kWall + 0.01).value(), 1);
}

TEST(SeenByFew, H173_AViewWithoutSurfacesHasNoShare) {
  const SampledView empty = SampleView(CameraAt(0), Image(kSeenW, kSeenH, 1));
  EXPECT_FALSE(SeenByFew(empty, {WallFrom(0)}, 0).has_value());
}

}  // namespace
}  // namespace regrade
