// Adaptive fits: convergence, refinement where photos ask for it, the same result for any
// number of threads and after a resume.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "reconstruct/fit/adapt_options.h"
#include "reconstruct/fit/fit_field.h"
#include "reconstruct/fit/initial_cells.h"
#include "reconstruct/fit/measure_cells.h"
#include "tests/support/ball_views.h"
#include "tests/support/cell_field.h"
#include "tests/support/expect_error.h"
#include "tests/support/record_error.h"

namespace regrade {
namespace {

class CellFit : public testing::FitField {
 protected:
  void SetUp() override {
    FitField::SetUp();
    options_ = FitOptions();
    options_.rays_per_step = 1024;
    options_.sh_degree = 1;
    options_.shards = 3;
    options_.resolutions = {6, 12, 24};
    options_.steps = {50, 50, 60};
    options_.tv_density = 1e-2f;
    options_.tv_sh = 1e-3f;
    options_.outward = 0;  // nothing is behind the ball
  }
};

TEST_F(CellFit, ReproducesAHeldOutViewWithFineCellsAtTheSurface) {
  const FitResult result = Fit();
  const CellGrid& cells = result.field.geometry->cells;
  Validate(result.field, "fit");
  RadianceField empty = result.field;
  auto geometry = std::make_shared<Geometry>(*empty.geometry);
  for (float& density : geometry->density) density = -1;
  empty.geometry = geometry;
  EXPECT_GT(HeldOutPsnr(result.field), HeldOutPsnr(empty) + 6.0);  // as the uniform fit
  EXPECT_EQ(result.rejected_voxels, 0);
  // The ball's surface is at a radius of 0.6: finest cells lie there, and none is as far out as
  // the box's corners.
  int64_t at_surface = 0, far_out = 0, finest = 0;
  for (int64_t c = 0; c < cells.num_cells(); ++c) {
    if (cells.level[c] < cells.finest) continue;
    ++finest;
    const Vec3i at = PlaceOf(cells.key[c]);
    const double n = result.field.geometry->frame.resolution.x;
    const double r =
        Norm(Vec3d{(2 * at.x + 1) / n - 1, (2 * at.y + 1) / n - 1, (2 * at.z + 1) / n - 1});
    at_surface += r > 0.4 && r < 0.8;
    far_out += r > 1.3;
  }
  EXPECT_GT(at_surface, 500);
  EXPECT_LT(far_out, finest / 10);
}

// Rates end with the last step that is taken, so a stage that is left out leaves no trace.
TEST_F(CellFit, AStageThatIsLeftOutChangesNothing) {
  const FitResult without = Fit();
  options_.resolutions.push_back(2048);
  options_.steps.push_back(400);
  EXPECT_TRUE(SameBits(Fit().field, without.field));
}

TEST_F(CellFit, TheBackgroundsMapsGrowWithTheStages) {
  box_.far_surroundings = true;
  options_.background_layers = 4;
  options_.background_resolution = 32;
  EXPECT_EQ(Fit().field.geometry->spheres.resolution, 32);
}

TEST_F(CellFit, SameBytesForAnyThreadCount) {
  EXPECT_TRUE(
      testing::RecordSameBits("1 and 3 threads", testing::Computed::kFloat,
                              SameBits(FitWithThreads(1).field, FitWithThreads(3).field)));
}

TEST_F(CellFit, H110_AResumedFitIsTheUndisturbedOne) {
  const FitResult straight = Fit();
  for (const int stop_after : {30, 50, 77, 130}) {
    FitState saved = StoppedFit(stop_after);
    EXPECT_TRUE(SameBits(straight.field, ResumedFit(&saved).field)) << stop_after;
  }
}

TEST(ApplyChanges, H191_ValuesStayAndMomentsFall) {
  const RadianceField field = testing::RandomCellField({2, 2, 2}, 3, 1, 5);
  FastGrid grid = MakeFastGrid(field);
  const CellGrid old = grid.cells();
  const Buffer<float> records = grid.records;
  Buffer<float> moment(grid.records.size());
  for (int64_t i = 0; i < moment.size(); ++i) moment[i] = static_cast<float>(i + 1);
  const Buffer<float> old_moment = moment;
  ApplyChanges(
      std::vector<CellChange>(static_cast<size_t>(old.num_cells()), CellChange::kSplit), &grid,
      &moment);
  ASSERT_GT(grid.cells().num_vertices(), old.num_vertices());
  const int lanes = grid.lanes();
  ASSERT_EQ(moment.size(), grid.cells().num_vertices() * lanes);
  for (int64_t v = 0; v < old.num_vertices(); ++v) {
    const int64_t now = FindKey(grid.cells().vertex_key, old.vertex_key[v]);
    ASSERT_GE(now, 0);
    for (int i = 0; i < lanes; ++i) {
      EXPECT_EQ(grid.records[now * lanes + i], records[v * lanes + i]);
      EXPECT_EQ(moment[now * lanes + i], old_moment[v * lanes + i] / 16);
    }
  }
}

TEST(ChooseChanges, H167_TheLimitOfCellsHoldsAndTheLargestErrorsAreSplit) {
  constexpr int64_t kCells = 1000;
  Buffer<uint8_t> level(kCells);
  CellStatistics statistics{Buffer<float>(kCells), Buffer<float>(kCells),
                            Buffer<uint64_t>(kCells)};
  for (int64_t c = 0; c < kCells; ++c) {
    statistics.weight[c] = c % 10 == 0 ? 0.0f : 0.5f;
    statistics.pixels[c] = c % 2 == 0 ? 0.8f : 3.0f;
    statistics.error[c] = static_cast<uint64_t>(c * 7919 % 1009 / 4);  // some are equal
    level[c] = static_cast<uint8_t>(c % 3);
  }
  CellLimits limits{.least_weight = 0.1f, .least_pixels = 1, .deepest = 2, .most_cells = 1200};
  const auto change = ChooseChanges(level, statistics, limits);
  int64_t cells = 0, split = 0;
  uint64_t least_split = ~uint64_t{0}, most_kept = 0;
  for (int64_t c = 0; c < kCells; ++c) {
    const CellChange what = change[static_cast<size_t>(c)];
    EXPECT_EQ(what == CellChange::kRemove, c % 10 == 0);
    const bool could = c % 10 != 0 && c % 2 == 1 && level[c] < 2;
    if (what == CellChange::kSplit) {
      EXPECT_TRUE(could);
      ++split;
      least_split = std::min(least_split, statistics.error[c]);
    } else if (could) {
      most_kept = std::max(most_kept, statistics.error[c]);
    }
    cells += what == CellChange::kRemove ? 0 : what == CellChange::kSplit ? 8 : 1;
  }
  EXPECT_LE(cells, 1200);
  EXPECT_GT(cells, 1200 - 8);
  EXPECT_GE(least_split, most_kept);
  limits.most_cells = 0;
  const auto unlimited = ChooseChanges(level, statistics, limits);
  EXPECT_GT(std::count(unlimited.begin(), unlimited.end(), CellChange::kSplit), split);
}

// Half the weight keeps a cell half as wide; wider ones than those of the first level need no
// more.
TEST(ChooseChanges, TheLeastWeightFallsWithACellsWidth) {
  const std::vector<float> kept_from{0.1f, 0.1f, 0.05f, 0.025f};  // by level
  const int64_t n = std::ssize(kept_from);
  Buffer<uint8_t> level(2 * n);
  CellStatistics statistics{Buffer<float>(2 * n), Buffer<float>(2 * n),
                            Buffer<uint64_t>(2 * n)};
  for (int64_t c = 0; c < 2 * n; ++c) {
    level[c] = static_cast<uint8_t>(c % n);
    statistics.weight[c] = kept_from[static_cast<size_t>(c % n)] * (c < n ? 1.0f : 0.99f);
  }
  const auto change =
      ChooseChanges(level, statistics, {.least_weight = 0.1f, .first_level = 1, .deepest = 3});
  for (int64_t c = 0; c < 2 * n; ++c)
    EXPECT_EQ(change[static_cast<size_t>(c)], c < n ? CellChange::kKeep : CellChange::kRemove);
}

// A pixel of a camera 2 units away with a focal length of 100 pixels is 0.02 units wide there.
TEST(WidthInPixels, IsTheCellsWidthOverThePixels) {
  const GridFrame frame{{100, 100, 100}, {0, 0, 0}, {1, 1, 1}};  // voxels of 0.02
  const Ray ray{{0, 0, -2}, {0, 0, 1}};
  const Ray beside{{0, 0, -2}, Normalized(Vec3f{0.02f, 0, 1})};
  EXPECT_NEAR(WidthInPixels(frame, ray, beside, 2, 2, 4), 4, 0.01);
}

// Three cameras side by side that look along z at the origin.
class ThreeViews {
 public:
  ThreeViews() : photo_(50, 50, 3) {
    std::fill(photo_.pixels.begin(), photo_.pixels.end(), 0.5f);
    Camera camera;
    camera.width = camera.height = 50;
    camera.fx = camera.fy = 50;
    camera.cx = camera.cy = 25;
    for (const double x : {-1.0, 0.0, 1.0}) {
      camera.camera_from_world.translation = {x, 0, 3};
      views_.push_back({camera, &photo_});
    }
  }
  const std::vector<TrainingView>& views() const { return views_; }

 private:
  Image photo_;
  std::vector<TrainingView> views_;
};

TEST(InitialCells, TheBoxHasTheCellsThatItHasAlone) {
  const ThreeViews three;
  const TrainingRays rays(three.views());
  SceneBox box;
  box.radius = {1, 0.75f, 0.5f};
  box.center = {0.1f, 0, 0};
  const CellLevels alone{1, 0}, around{1, 2};
  const GridFrame inner = CellFrame(box, 16, alone), outer = CellFrame(box, 16, around);
  EXPECT_EQ(outer.resolution, inner.resolution * 4);
  EXPECT_EQ(outer.radius, inner.radius * 4.0f);
  const FastGrid in_box = MakeInitialCells(rays, inner, alone, 1, 0.5f, 0, 2, false);
  const FastGrid all = MakeInitialCells(rays, outer, around, 1, 0.5f, 0, 2, false);
  std::set<CellKey> expected, found;
  for (const CellKey key : in_box.cells().key) expected.insert(key);
  int64_t outside = 0;
  for (int64_t c = 0; c < all.cells().num_cells(); ++c) {
    if (all.cells().level[c] < around.outward) {
      ++outside;
      continue;
    }
    const Vec3i low = PlaceOf(all.cells().key[c]);
    found.insert(KeyOf({low.x - 3 * inner.resolution.x / 2, low.y - 3 * inner.resolution.y / 2,
                        low.z - 3 * inner.resolution.z / 2}));
  }
  EXPECT_EQ(found, expected);
  EXPECT_GT(outside, 0);
}

TEST(DensityRates, FallWhereFewPhotosSee) {
  const ThreeViews three;
  const TrainingRays rays(three.views());
  const GridFrame frame{{16, 16, 16}, {0, 0, 0}, {1, 1, 1}};
  const FastGrid grid = MakeInitialCells(rays, frame, {2, 0}, 1, 0.5f, 0, 1, false);
  ASSERT_EQ(grid.density_rate.size(), grid.cells().num_vertices());
  float least = 2, most = 0;
  for (const float rate : grid.density_rate) {
    least = std::min(least, rate);
    most = std::max(most, rate);
  }
  EXPECT_FLOAT_EQ(most, 1);  // all three see the middle
  EXPECT_LT(least, 0.7f);
  EXPECT_GT(least, 0);
}

// Three cameras that look outwards from a circle around the box's middle.
std::vector<TrainingView> OutwardViews(const Image& photo) {
  std::vector<TrainingView> views;
  for (const double angle : {0.0, 2 * M_PI / 3, 4 * M_PI / 3}) {
    Camera camera;
    camera.width = photo.width;
    camera.height = photo.height;
    camera.fx = camera.fy = photo.width;
    camera.cx = photo.width / 2.0;
    camera.cy = photo.height / 2.0;
    const double s = std::sin(angle), c = std::cos(angle);
    camera.camera_from_world = {{{{c, 0, -s}, {0, 1, 0}, {s, 0, c}}}, {0, 0, -0.5}};
    views.push_back({camera, &photo});
  }
  return views;
}

TEST(FitOfWrongPoses, NoPlaceIsSeenByTwoPhotos) {
  Image photo(32, 32, 3);
  std::ranges::fill(photo.pixels, 0.5f);
  const std::vector<TrainingView> outward = OutwardViews(photo);
  FitOptions adaptive;
  adaptive.resolutions = {8, 16};
  adaptive.steps = {2, 2};
  adaptive.fewer_stages = false;
  FitOptions uniform = adaptive, whole_box = adaptive;
  uniform.MakeUniform();
  whole_box.MakeUniform();
  whole_box.initial_views = 0;
  for (const FitOptions& options : {adaptive, uniform, whole_box}) {
    EXPECT_REGRADE_ERROR(FitField(outward, {}, options, {}), ExitCode::kScene,
                         "no place is seen by two of the 3 photos");
    SceneBox spheres;
    spheres.far_surroundings = true;
    EXPECT_REGRADE_ERROR(FitField(outward, spheres, options, {}), ExitCode::kScene,
                         "no place is seen by two of the 3 photos");
  }
}

// In device coordinates: cameras that see different parts of the box.
TEST(FitOfWrongPoses, NoPlaceInDeviceCoordinatesIsSeenByTwoPhotos) {
  Image photo(32, 32, 3);
  std::ranges::fill(photo.pixels, 0.5f);
  std::vector<TrainingView> apart = OutwardViews(photo);
  SceneBox box;
  box.layers = 16;
  for (size_t i = 0; i < apart.size(); ++i) {
    apart[i].camera.camera_from_world = {{}, {-1e6 * static_cast<double>(i), 0, 0}};
    apart[i].camera.ndc = {2, 2};
  }
  FitOptions options;
  options.resolutions = {8};
  options.steps = {2};
  EXPECT_REGRADE_ERROR(FitField(apart, box, options, {}), ExitCode::kScene,
                       "no place is seen by two");
}

TEST(FitOfWrongPoses, PruningEveryCellIsAnError) {
  const ThreeViews three;
  FitOptions options;
  options.resolutions = {8, 16};
  options.steps = {2, 2};
  options.fewer_stages = false;
  options.prune_weight = 1e6f;
  EXPECT_REGRADE_ERROR(FitField(three.views(), {}, options, {}), ExitCode::kScene,
                       "no cell of the scene is left");
}

}  // namespace
}  // namespace regrade
