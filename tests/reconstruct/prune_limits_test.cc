// Grids whose sides are given, and pruning by weight, by density and to a number of voxels.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "reconstruct/fit/fit_field.h"
#include "reconstruct/fit/resample_grid.h"

namespace regrade {
namespace {

TEST(GridOfStage, SidesAreTheBoxsOrGiven) {
  FitOptions options;
  options.resolutions = {16, 64};
  SceneBox box;
  box.radius = {1, 0.5f, 0.25f};
  EXPECT_EQ(GridOfStage(options, box, 1), (Vec3i{64, 32, 16}));
  options.resolutions_y = {8, 40};
  options.resolutions_z = {4, 4};
  EXPECT_EQ(GridOfStage(options, box, 0), (Vec3i{16, 8, 4}));
  EXPECT_EQ(GridOfStage(options, box, 1), (Vec3i{64, 40, 4}));
}

// The limit rises to the value that leaves as many as are allowed, and never falls.
TEST(BoundedLimit, RisesWhereMoreWouldStay) {
  Buffer<float> weights(100);
  for (int64_t i = 0; i < 100; ++i) weights[i] = static_cast<float>((37 * i) % 100);
  const auto kept = [&](float limit) {
    return std::ranges::count_if(weights, [limit](float w) { return w >= limit; });
  };
  EXPECT_EQ(BoundedLimit(weights, 20, 0), 20.0f);
  EXPECT_EQ(BoundedLimit(weights, 20, 80), 20.0f);
  EXPECT_EQ(kept(BoundedLimit(weights, 20, 30)), 30);
  EXPECT_EQ(kept(BoundedLimit(weights, 20, 1)), 1);
}

// A box before one camera, grey: the dense half stays, by its density alone.
class PruneBy : public ::testing::Test {
 protected:
  PruneBy() : photo_(24, 24, 3) {
    std::ranges::fill(photo_.pixels, 0.5f);
    camera_.width = camera_.height = 24;
    camera_.fx = camera_.fy = 48;
    camera_.cx = camera_.cy = 12;
    camera_.camera_from_world.translation = {0, 0, 3};
    options_.resolutions = {12};
    options_.steps = {1};
    options_.rays_per_step = 16;
    options_.rate_density = options_.rate_density_end = 0;
    options_.initial_density = 1;
    options_.initial_views = 0;
  }
  int64_t Voxels() {
    const SceneBox box;
    return regrade::FitField({{camera_, &photo_}}, box, options_, {}).voxels;
  }
  Image photo_;
  Camera camera_;
  FitOptions options_;
};

TEST_F(PruneBy, TheWholeBoxIsStoredAndKeptWithoutViewsAndPruning) {
  options_.prune_last = false;
  EXPECT_EQ(Voxels(), 12 * 12 * 12);
  options_.initial_views = 1;
  const int64_t seen = Voxels();
  EXPECT_LT(seen, 12 * 12 * 12);
  EXPECT_GT(seen, 0);
}

TEST_F(PruneBy, DensityDoesNotAskWhatPhotosSee) {
  options_.prune_weight = 0.9f;
  const int64_t by_weight = [this] {
    options_.prune_by = "weight";
    options_.prune_weight = 0.5f;
    return Voxels();
  }();
  EXPECT_LT(by_weight, 12 * 12 * 12);
  options_.prune_by = "density";
  options_.prune_weight = 0.9f;
  EXPECT_EQ(Voxels(), 12 * 12 * 12);
  options_.prune_weight = 1.1f;
  EXPECT_THROW(Voxels(), Error);  // none is as dense
}

}  // namespace
}  // namespace regrade
