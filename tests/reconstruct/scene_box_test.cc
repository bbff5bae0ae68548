// The resolution of a scene's grid.
#include "reconstruct/scene/scene_box.h"

#include <gtest/gtest.h>

#include "kernels/scene/ndc.h"

namespace regrade {
namespace {

TEST(SceneBox, VoxelsAreCubes) {
  const Vec3i n = ResolutionFor({.radius = {1, 0.5f, 0.25f}}, 128);
  EXPECT_EQ(n.x, 128);
  EXPECT_EQ(n.y, 64);
  EXPECT_EQ(n.z, 32);
}

TEST(SceneBox, EveryAxisHasACell) {
  EXPECT_EQ(ResolutionFor({.radius = {1, 1, 1e-6f}}, 16).z, 2);
}

// H98: in NDC a picture is 2 wide and 2 high. Voxels that are as many pixels wide as high do
// not waste a third of the grid on the shorter side.
TEST(SceneBox, H98_VoxelsOfNdcAreAsManyPixelsWideAsHigh) {
  const double focal = 900;
  for (const auto& [width, height] : {std::pair{1008, 756}, std::pair{540, 960}}) {
    const NdcSpace ndc{2 * focal / width, 2 * focal / height};
    SceneBox box{.radius = {1.4f, 1.3f, 1}, .layers = 128};
    box.voxel_aspect = VoxelAspect(ndc);
    const Vec3i n = ResolutionFor(box, 1408);
    const double pixels_wide = box.radius.x * width / n.x;
    const double pixels_high = box.radius.y * height / n.y;
    EXPECT_EQ(std::max(n.x, n.y), 1408);
    EXPECT_EQ(n.z, 128);
    // Sides are rounded to whole voxels: 1 in 1000.
    EXPECT_NEAR(pixels_wide, pixels_high, 2e-3);
  }
  EXPECT_EQ(VoxelAspect(NdcSpace()), 1.0f);
}

}  // namespace
}  // namespace regrade
