// Where splats begin far outside of the box.
#include "reconstruct/splats/initial_splats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "tests/support/pinhole.h"

namespace regrade {
namespace {

// Photos of one colour each from four places in the box, which look along z at a point that all
// see.
class FarStarts : public ::testing::Test {
 protected:
  // Those that begin beyond the box.
  std::vector<Vec3f> ColorsOfFar(const std::vector<float>& greys) {
    std::deque<Image> photos;
    std::vector<TrainingView> views;
    for (size_t v = 0; v < greys.size(); ++v) {
      photos.emplace_back(32, 24);
      for (float& value : photos.back().pixels) value = greys[v];
      Camera camera = testing::PinholeOf(32, 24, 30);
      camera.camera_from_world.translation = {0.1 * static_cast<double>(v), 0, 0.5};
      views.push_back({camera, &photos.back(), {}});
      for (int i = 0; i < 60; ++i)
        views.back().points.push_back({{0.01f * static_cast<float>(i), 0, 0.5f}, 0.01f});
    }
    const Splats splats = InitialSplats(views, SplatPhotos(views), box_, options_);
    std::vector<Vec3f> colors;
    for (size_t i = 0; i < static_cast<size_t>(splats.count()); ++i) {
      const float* const p = &splats.mean[3 * i];
      if (std::hypot(p[0], p[1], p[2]) > 2)
        colors.push_back({splats.sh[3 * i], splats.sh[3 * i + 1], splats.sh[3 * i + 2]});
    }
    return colors;
  }

  SceneBox box_{.far_surroundings = true};
  SplatFitOptions options_{.thousands = 4};
};

TEST_F(FarStarts, LieWherePhotosAgree) {
  const std::vector<Vec3f> colors = ColorsOfFar({0.3f, 0.3f, 0.3f, 0.9f});
  EXPECT_GT(colors.size(), 10u);
  EXPECT_LT(colors.size(), 100u);  // of 500 directions, those that a photo shows
  for (const Vec3f& color : colors)
    EXPECT_NEAR(color.x, (0.3f - 0.5f) / 0.28209479f, 1e-3f);  // of degree 0
}

TEST_F(FarStarts, NoneWherePhotosDiffer) {
  EXPECT_TRUE(ColorsOfFar({0.3f, 0.5f, 0.7f, 0.9f}).empty());
  EXPECT_TRUE(ColorsOfFar({0.3f, 0.3f, 0.7f, 0.9f}).empty());
  EXPECT_TRUE(ColorsOfFar({0.3f, 0.3f}).empty());
}

TEST_F(FarStarts, NoneWithoutSurroundingsOrBeforeAKnownBackground) {
  box_.background = Vec3f{1, 1, 1};
  EXPECT_TRUE(ColorsOfFar({0.3f, 0.3f, 0.3f, 0.3f}).empty());
  box_ = {};
  EXPECT_TRUE(ColorsOfFar({0.3f, 0.3f, 0.3f, 0.3f}).empty());
}

}  // namespace
}  // namespace regrade
