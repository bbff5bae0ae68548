#include "kernels/image/undistort_photo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/support/pinhole.h"

namespace regrade {
namespace {

Camera Lens(double k1) {
  Camera camera = testing::PinholeOf(96, 64, 70, 47, 33);
  camera.lens = LensModel::kOpenCv;
  camera.distortion[0] = k1;
  camera.distortion[2] = 1e-3;
  // Has no influence: the lens alone decides.
  camera.camera_from_world.translation = {3, -2, 5};
  return camera;
}

double Scene(double x, double y) { return 0.5 + 0.2 * std::sin(9 * x) + 0.2 * std::cos(7 * y); }

// What a lens shows of a smooth scene at infinity.
Image PhotoOf(const Camera& camera) {
  Image photo(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d ray = camera.CameraRay(x + 0.5, y + 0.5);
      for (int c = 0; c < 3; ++c)
        photo.at(x, y)[c] = static_cast<float>(Scene(ray.x / ray.z, ray.y / ray.z + 0.1 * c));
    }
  return photo;
}

TEST(UndistortPhoto, IsThePhotoOfALensWithoutDistortion) {
  for (const double k1 : {-0.2, 0.15}) {
    const Camera camera = Lens(k1);
    const Image plain = PhotoOf(camera.Undistorted());
    const Image undistorted = UndistortPhoto(PhotoOf(camera), camera);
    int64_t seen = 0;
    double worst = 0;
    for (size_t i = 0; i < plain.pixels.size(); ++i) {
      if (!std::isfinite(undistorted.pixels[i])) continue;
      ++seen;
      worst = std::max(worst,
                       std::abs(static_cast<double>(undistorted.pixels[i] - plain.pixels[i])));
    }
    EXPECT_LT(worst, 0.01) << k1;  // of a wave of 48 pixels, with edges repeated at the border
    // A pincushion's corners were outside of the photo, a barrel's photo shows them all.
    if (k1 < 0)
      EXPECT_EQ(seen, static_cast<int64_t>(plain.pixels.size()));
    else
      EXPECT_LT(seen, static_cast<int64_t>(plain.pixels.size()));
  }
}

TEST(UndistortPhoto, APinholesPhotoStaysAsItIs) {
  const Camera camera = Lens(0.1).Undistorted();
  const Image photo = PhotoOf(camera);
  EXPECT_EQ(UndistortPhoto(photo, camera).pixels, photo.pixels);
}

// r (1 - 4 r^2) turns back at r = 0.29: nothing beyond it is shown a second time.
TEST(UndistortPhoto, WhatIsBeyondAFoldIsMissing) {
  const Camera camera = Lens(-4);
  const Image undistorted = UndistortPhoto(PhotoOf(camera), camera);
  const Camera plain = camera.Undistorted();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d ray = plain.CameraRay(x + 0.5, y + 0.5);
      const double r = std::hypot(ray.x, ray.y);
      if (r > 0.25 && r < 0.31) continue;
      EXPECT_EQ(std::isfinite(undistorted.at(x, y)[0]), r <= 0.25) << x << ' ' << y;
    }
}

}  // namespace
}  // namespace regrade
