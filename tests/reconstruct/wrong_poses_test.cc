// Fits of photos whose poses are wrong: no place is seen by two of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "reconstruct/fit/fit_field.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"

namespace regrade {
namespace {

// Three cameras that look outwards from a circle around the box's middle.
std::vector<TrainingView> OutwardViews(const Image& photo) {
  std::vector<TrainingView> views;
  for (const double angle : {0.0, 2 * M_PI / 3, 4 * M_PI / 3}) {
    Camera camera = testing::PinholeOf(photo.width, photo.height, photo.width);
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
  FitOptions options;
  options.resolutions = {8, 16};
  options.steps = {2, 2};
  for (const int initial_views : {2, 0}) {
    options.initial_views = initial_views;
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
  for (const int initial_views : {2, 0}) {
    options.initial_views = initial_views;
    EXPECT_REGRADE_ERROR(FitField(apart, box, options, {}), ExitCode::kScene,
                         "no place is seen by two");
  }
}

}  // namespace
}  // namespace regrade
