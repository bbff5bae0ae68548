// Models that were given: too few poses, cameras far away, and pictures that EXIF turned.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "reconstruct/colmap/far_cameras.h"
#include "reconstruct/colmap/photo_statuses.h"
#include "reconstruct/colmap/turned_model.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

using testing::MakeSyntheticModel;
using testing::PhotosOf;

void Require(int posed, int photos, const PoseOptions& options = {}) {
  const ColmapModel model = MakeSyntheticModel({.images = posed});
  const std::vector<StagedPhoto> all = PhotosOf(model, photos - posed);
  RequirePoses(CaptureFromModel(model, all), all, options, "sparse/0");
}

TEST(RequirePoses, TheMinimaOfPhotosHoldForGivenPoses) {
  Require(6, 12);
  Require(5, 5);
  EXPECT_REGRADE_ERROR(Require(2, 12), ExitCode::kScene, "2 of 12 photos have a pose");
  EXPECT_REGRADE_ERROR(Require(4, 4), ExitCode::kScene, "at least 5");
  EXPECT_REGRADE_ERROR(Require(5, 12), ExitCode::kScene, "5 of 12 photos have a pose");
  EXPECT_REGRADE_ERROR(Require(5, 12), ExitCode::kScene, "sparse/0");
  PoseOptions fewer;
  fewer.min_photos = 2;
  fewer.min_registered = 0.1;
  Require(2, 12, fewer);
}

// A model of the JPEG files of a folder that has the raw files, too.
TEST(RequirePoses, TheOtherFileOfAShotNeedsNone) {
  const ColmapModel model = MakeSyntheticModel({.images = 6});
  std::vector<StagedPhoto> photos = PhotosOf(model);
  for (int copies = 0; copies < 2; ++copies)
    for (int i = 0; i < 6; ++i) {
      StagedPhoto other = photos[static_cast<size_t>(i)];
      other.file = "IMG " + std::to_string(i) + (copies ? ".tif" : ".heic");
      other.name = "other";
      photos.push_back(other);
    }
  RequirePoses(CaptureFromModel(model, photos), photos, {}, "sparse/0");
}

TEST(TakeOutFarCameras, OneThatNoPointConfirmsIsLeftOut) {
  ColmapModel model = MakeSyntheticModel();
  EXPECT_TRUE(TakeOutFarCameras(&model).empty());
  EXPECT_EQ(model.images.size(), 8u);
  model.images[2].camera_from_world.translation.x = 1e9;
  const std::vector<FarCamera> far = TakeOutFarCameras(&model);
  ASSERT_EQ(far.size(), 1u);
  EXPECT_EQ(far[0].image, testing::StagedName(2));
  EXPECT_GT(far[0].times, 1e8);
  EXPECT_EQ(model.images.size(), 7u);
  for (const ColmapPoint& point : model.points) {
    EXPECT_EQ(point.track.size(), 7u);
    for (const ColmapTrackElement& element : point.track) EXPECT_NE(element.image_id, 3u);
  }
}

// An overview from far away, of which the points say that it is right.
TEST(TakeOutFarCameras, OneThatPointsConfirmStays) {
  ColmapModel model = MakeSyntheticModel();
  ColmapImage& overview = model.images[2];
  overview.camera_from_world.translation = {0, 0, 500};
  for (ColmapKeypoint& keypoint : overview.keypoints)
    model.CameraOf(overview).Project(model.FindPoint(keypoint.point_id)->position, &keypoint.u,
                                     &keypoint.v);
  EXPECT_TRUE(TakeOutFarCameras(&model).empty());
  EXPECT_EQ(model.images.size(), 8u);
}

// The turned camera sees each point where the turned picture shows it.
TEST(TurnUpright, CamerasFollowTheirPictures) {
  for (const int orientation : {3, 6, 8}) {
    ColmapModel model = MakeSyntheticModel({.lens = ColmapLens::kOpenCv});
    Camera& camera = model.cameras[0].intrinsics;
    camera.cx = 300, camera.cy = 250, camera.fx = 620;
    camera.distortion = {-0.1, 0.02, 0.003, -0.002};
    const ColmapModel stored = model;
    TurnUpright({{testing::StagedName(1), orientation}}, &model);
    EXPECT_EQ(model.cameras.size(), 2u);
    const Camera before = stored.CameraOf(stored.images[1]),
                 after = model.CameraOf(model.images[1]);
    EXPECT_EQ(after.width, orientation == 3 ? 640 : 480);
    EXPECT_NEAR(Norm(after.Center() - before.Center()), 0, 1e-12);
    for (size_t p = 0; p < stored.points.size(); ++p) {
      const Vec3d& point = stored.points[p].position;
      double u, v, x, y;
      ASSERT_TRUE(before.Project(point, &u, &v));
      TurnPoint(orientation, 640, 480, &u, &v);
      ASSERT_TRUE(after.Project(point, &x, &y));
      EXPECT_NEAR(std::hypot(u - x, v - y), 0, 1e-9) << orientation;  // pixels, in double
    }
    EXPECT_EQ(model.images[0].camera_id, 1u);
  }
}

}  // namespace
}  // namespace regrade
