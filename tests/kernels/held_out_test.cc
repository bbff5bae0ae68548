// Which photos are held out: every n-th place, with all photos of that place.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/scene/capture.h"

namespace regrade {
namespace {

// A camera at (x, 0, 0) that looks along z, turned by `turn_deg` about the vertical.
CaptureView ViewAt(double x, double turn_deg = 0) {
  const double s = std::sin(turn_deg * M_PI / 180), c = std::cos(turn_deg * M_PI / 180);
  CaptureView view;
  view.camera.camera_from_world.rotation = {{{c, 0, -s}, {0, 1, 0}, {s, 0, c}}};
  view.camera.camera_from_world.translation =
      -(view.camera.camera_from_world.rotation * Vec3d{x, 0, 0});
  return view;
}

Capture Row(int places, int photos_a_place) {
  Capture capture;
  for (int i = 0; i < places; ++i)
    for (int k = 0; k < photos_a_place; ++k) capture.views.push_back(ViewAt(i + 0.001 * k));
  return capture;
}

std::vector<int> HeldOut(const Capture& capture, int holdout) {
  std::vector<int> indices;
  const std::vector<bool> held = HeldOutViews(capture, holdout);
  for (size_t i = 0; i < held.size(); ++i)
    if (held[i]) indices.push_back(static_cast<int>(i));
  return indices;
}

TEST(HeldOutViews, AreEveryNthPhoto) {
  EXPECT_EQ(HeldOut(Row(20, 1), 8), (std::vector<int>{0, 8, 16}));
  EXPECT_EQ(HeldOut(Row(5, 1), 2), (std::vector<int>{0, 2, 4}));
  EXPECT_EQ(HeldOut(Row(20, 1), 0), std::vector<int>{});
}

TEST(HeldOutViews, PhotosFromOnePlaceAreHeldOutTogether) {
  EXPECT_EQ(HeldOut(Row(10, 2), 8), (std::vector<int>{0, 1, 16, 17}));
  EXPECT_EQ(HeldOut(Row(10, 3), 5), (std::vector<int>{0, 1, 2, 15, 16, 17}));
}

// The second file of each shot is listed after all first ones.
TEST(HeldOutViews, TwinsNeedNotFollowEachOther) {
  Capture capture = Row(9, 1);
  for (int i = 0; i < 9; ++i) capture.views.push_back(ViewAt(i + 0.001));
  EXPECT_EQ(HeldOut(capture, 8), (std::vector<int>{0, 8, 9, 17}));
}

TEST(HeldOutViews, ATurnedCameraIsNoTwin) {
  Capture capture = Row(8, 1);
  capture.views.push_back(ViewAt(0, 40));
  EXPECT_EQ(HeldOut(capture, 8), (std::vector<int>{0, 8}));
}

TEST(HeldOutViews, MostPhotosStay) {
  EXPECT_EQ(HeldOut(Row(1, 1), 8), std::vector<int>{});
  EXPECT_EQ(HeldOut(Row(2, 1), 8), std::vector<int>{});
  EXPECT_EQ(HeldOut(Row(3, 1), 8), std::vector<int>{0});
  EXPECT_EQ(HeldOut(Row(8, 1), 1), (std::vector<int>{0, 1, 2, 3}));
  Capture burst = Row(1, 20);
  for (int i = 1; i < 12; ++i) burst.views.push_back(ViewAt(i));
  for (int i = 0; i < 20; ++i) burst.views[static_cast<size_t>(i)] = ViewAt(1e-4 * i);
  EXPECT_EQ(HeldOut(burst, 8), (std::vector<int>{20, 28}));
}

TEST(HeldOutViews, ASplitThatPosesNameIsKept) {
  Capture capture = Row(4, 1);
  for (int i = 1; i < 4; ++i) capture.views[static_cast<size_t>(i)].test = true;
  EXPECT_EQ(HeldOut(capture, 8), (std::vector<int>{1, 2, 3}));
}

}  // namespace
}  // namespace regrade
