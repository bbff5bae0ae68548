// Rays and orders used to render frames on a GPU, tested on the host.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/field/cuda/brick_order.h"
#include "kernels/scene/pinhole_rays.h"

namespace regrade {
namespace {

Camera SmallCamera() {
  Camera camera;
  camera.width = 40;
  camera.height = 30;
  camera.fx = 37;
  camera.fy = 39;
  camera.cx = 21;
  camera.cy = 14;
  return camera;
}

// The same operations in the same order: bit-identical.
TEST(PinholeRays, EqualTheCamerasRays) {
  Camera camera = SmallCamera();
  const double angle = 0.4;
  camera.camera_from_world.rotation.row[0] = {std::cos(angle), 0, -std::sin(angle)};
  camera.camera_from_world.rotation.row[2] = {std::sin(angle), 0, std::cos(angle)};
  camera.camera_from_world.translation = {0.3, -0.7, 1.9};
  for (const bool ndc : {false, true}) {
    if (ndc) camera.ndc = {2 * 37.0 / 40, 2 * 39.0 / 30};
    const PinholeRays rays(camera);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const Ray expected = camera.PixelRay(x, y), ray = rays.At(x, y);
        ASSERT_EQ(ray.origin, expected.origin) << x << " " << y;
        ASSERT_EQ(ray.direction, expected.direction) << x << " " << y;
      }
  }
}

// Every vertex has a place, and no two have the same.
TEST(BrickOrder, IndexesEveryVertexOnce) {
  for (const Vec3i n : {Vec3i{5, 7, 9}, Vec3i{4, 8, 4}, Vec3i{2, 3, 13}}) {
    const BrickOrder order(n);
    std::vector<bool> taken(static_cast<size_t>(order.size));
    for (int x = 0; x < n.x; ++x)
      for (int y = 0; y < n.y; ++y)
        for (int z = 0; z < n.z; ++z) {
          const int32_t index = order.Index(x, y, z);
          ASSERT_GE(index, 0);
          ASSERT_LT(index, order.size);
          ASSERT_FALSE(taken[static_cast<size_t>(index)]);
          taken[static_cast<size_t>(index)] = true;
          ASSERT_EQ(order.At(index), (Vec3i{x, y, z}));
        }
    EXPECT_EQ(order.Index(1, 1, 1) - order.Index(0, 0, 0), 21);
  }
}

}  // namespace
}  // namespace regrade
