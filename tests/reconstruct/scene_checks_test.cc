// Checks of reliable and unreliable scene geometry.
#include "reconstruct/scene/scene_checks.h"

#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/colmap/colmap_model.h"
#include "reconstruct/scene/given_poses.h"
#include "reconstruct/scene/lens_fold.h"
#include "tests/support/expect_error.h"
#include "tests/support/pinhole.h"
#include "tests/support/record_error.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

using testing::MakeSyntheticModel;
using testing::SyntheticModelOptions;

Capture CaptureOf(const SyntheticModelOptions& options) {
  const ColmapModel model = MakeSyntheticModel(options);
  return CaptureFromModel(model, testing::PhotosOf(model));
}

TEST(SceneChecks, TriangulationAngleOfAnExactCase) {
  Capture capture;
  for (const double x : {-1.0, 0.5, 1.0}) {
    CaptureView view;
    view.camera.camera_from_world.translation = {-x, 0, 0};
    capture.views.push_back(view);
  }
  ScenePoint point;
  point.position = {0, 0, 1};
  point.views = {0, 1, 2};
  capture.points = {point};
  // The outer two, at 45 degrees.
  EXPECT_NEAR(MedianTriangulationAngle(capture), M_PI / 2, 1e-12);
  capture.points[0].views = {1, 2};
  EXPECT_NEAR(MedianTriangulationAngle(capture), M_PI / 4 - std::atan(0.5), 1e-12);
  EXPECT_EQ(MedianTriangulationAngle({}), 0);
  std::vector<Vec3d> centers;
  for (const CaptureView& view : capture.views) centers.push_back(view.camera.Center());
  EXPECT_NEAR(LargestDistance(centers), 2, 1e-12);
}

TEST(SceneChecks, GoodCaptureIsAccepted) {
  const SceneAssessment assessment = AssessScene(CaptureOf({}));
  EXPECT_EQ(assessment.refusal, "");
  EXPECT_TRUE(assessment.notes.empty());
}

TEST(SceneChecks, H127_CameraThatOnlyTurnsIsRefused) {
  const SceneAssessment assessment = AssessScene(CaptureOf({.arc_deg = 0.4}));
  EXPECT_NE(assessment.refusal.find("nearly one place"), std::string::npos)
      << assessment.refusal;
  EXPECT_NE(assessment.remedy.find("sideways"), std::string::npos);
}

TEST(SceneChecks, H128_PlaneIsANoteNotARefusal) {
  const SceneAssessment assessment = AssessScene(CaptureOf({.thickness = 0.001}));
  EXPECT_EQ(assessment.refusal, "");
  ASSERT_EQ(assessment.notes.size(), 1u);
  EXPECT_NE(assessment.notes[0].find("plane"), std::string::npos);
}

TEST(SceneChecks, H128_OneOutlierDoesNotHideThePlane) {
  Capture capture = CaptureOf({.thickness = 0.001});
  capture.points[0].position = {0, 0, 1000};
  EXPECT_LT(PointExtents(capture).z, 0.01);
}

TEST(SceneChecks, H134_PixelsThatAreNotSquareAreRefused) {
  SyntheticModelOptions options{.lens = ColmapLens::kOpenCv};
  options.aspect = 0.7;
  EXPECT_NEAR(WorstPixelAspect(CaptureOf(options)), 0.7, 1e-12);
  EXPECT_NE(AssessScene(CaptureOf(options)).refusal.find("not square"), std::string::npos);
  options.aspect = 1.04;
  EXPECT_EQ(AssessScene(CaptureOf(options)).refusal, "");
}

TEST(SceneChecks, H172_LensesThatNoCameraHas) {
  const auto lens_of = [](double focal, double k1, double k2) {
    Capture capture = CaptureOf({.lens = ColmapLens::kOpenCv});
    for (CaptureView& view : capture.views) {
      view.camera.fx = view.camera.fy = focal * view.camera.width;
      view.camera.distortion[0] = k1;
      view.camera.distortion[1] = k2;
    }
    return AssessScene(capture).lens;
  };
  EXPECT_NE(lens_of(0.09, 0, 0).find("0.09 times"), std::string::npos);
  EXPECT_NE(lens_of(12, 0, 0).find("12.00 times"), std::string::npos);
  EXPECT_EQ(lens_of(0.11, 0, 0), "");
  EXPECT_EQ(lens_of(9, 0, 0), "");
  // At f = 0.9 W the corners are at r^2 = 0.48: r (1 + k1 r^2) falls beyond r^2 = -1 / (3 k1).
  EXPECT_EQ(lens_of(0.9, -0.2, 0), "");  // a real wide-angle lens
  EXPECT_NE(lens_of(0.9, -0.9, 0).find("folds"), std::string::npos);
  EXPECT_EQ(lens_of(0.9, 0.3, 0), "");  // pincushion
  EXPECT_NE(lens_of(0.9, 0, -8).find("folds"), std::string::npos);
}

TEST(SceneChecks, TooFewViewsAreRefused) {
  EXPECT_NE(AssessScene(CaptureOf({.images = 4})).refusal.find("only 4 photos"),
            std::string::npos);
  EXPECT_EQ(AssessScene(CaptureOf({.images = 5})).refusal, "");
}

TEST(SceneChecks, EmptyCaptureIsRefusedWithoutDividingByZero) {
  EXPECT_NE(AssessScene({}).refusal, "");
  EXPECT_EQ(PointExtents({}), Vec3d{});
  EXPECT_EQ(WorstPixelAspect({}), 1);
}

// H140: the measures are angles and ratios, independent of the world's scale.
TEST(SceneChecks, H140_ScaleDoesNotMatter) {
  for (const double scale : {1e-6, 1e6}) {
    Capture capture = CaptureOf({});
    const double angle = MedianTriangulationAngle(capture);
    const Similarity similarity{scale, {}, {1 * scale, 2 * scale, 3 * scale}};
    for (CaptureView& view : capture.views) view.camera = view.camera.Transformed(similarity);
    for (ScenePoint& point : capture.points) point.position = similarity * point.position;
    EXPECT_NEAR(MedianTriangulationAngle(capture), angle,
                testing::RecordBound("the angle in other units", testing::Computed::kDouble,
                                     MedianTriangulationAngle(capture) - angle, 1e-9));
    EXPECT_EQ(AssessScene(capture).refusal, "");
  }
}

TEST(FoldRadius, IsWhereTheDistortionStopsGrowing) {
  Camera camera = testing::PinholeOf(640, 480, 500);
  EXPECT_EQ(FoldRadius(camera), 0);
  camera.lens = LensModel::kOpenCv;
  camera.distortion = {-0.2};
  EXPECT_EQ(FoldRadius(camera), 0);
  // r - r^3 grows up to r = 1 / sqrt(3), where it is 0.385.
  camera.distortion = {-1};
  EXPECT_NEAR(FoldRadius(camera), 500 * 0.3849, 1);
  // r - 1e5 r^5 grows up to r = 5e5^(-1/4).
  camera.distortion = {0, -1e5};
  EXPECT_NEAR(FoldRadius(camera), 500 * 0.8 * std::pow(5e5, -0.25), 0.5);
  // Falls between r = 0.45 and 0.47, within the picture, and grows again to its corner.
  camera.distortion = {-3.2, 4.6};
  EXPECT_GT(FoldRadius(camera), 100);
  EXPECT_LT(FoldRadius(camera), 200);
  camera.lens = LensModel::kFisheye;
  camera.distortion = {};
  EXPECT_EQ(FoldRadius(camera), 0);
  camera.distortion = {-2};
  EXPECT_NEAR(FoldRadius(camera), 500 * 2 / 3.0 / std::sqrt(6.0), 1);
}

void ExpectRefused(const Capture& capture, const char* part) {
  EXPECT_REGRADE_ERROR(RequireSoundPoses(capture, "poses"), ExitCode::kScene, part);
}

TEST(RequireSoundPoses, PosesWithoutABaselineShowNoDepth) {
  RequireSoundPoses(CaptureOf({}), "poses");
  RequireSoundPoses(CaptureOf({.arc_deg = 2}), "poses");
  ExpectRefused(CaptureOf({.arc_deg = 0.1}), "degrees (needed");
  ExpectRefused(CaptureOf({.arc_deg = 0}), "at one place");
  Capture turning = CaptureOf({});
  turning.points.clear();
  RequireSoundPoses(turning, "poses");
  turning.nearest_depth = 1e4;
  ExpectRefused(turning, "degrees");
  turning.nearest_depth = 0;
  for (CaptureView& view : turning.views) view.camera.camera_from_world.translation = {};
  ExpectRefused(turning, "at one place");
}

TEST(RequireSoundPoses, ALensThatFoldsThePictureIsRefusedWithThePhoto) {
  Capture capture = CaptureOf({.lens = ColmapLens::kOpenCv});
  capture.views[3].camera.distortion = {0, -1e5};
  ExpectRefused(capture, capture.views[3].file.c_str());
}

// Points that only two photos from one place see lie anywhere along their rays.
TEST(WithParallax, LeavesOutPointsOfUnknownDistance) {
  Capture capture = CaptureOf({.points = 200});
  CaptureView twin = capture.views[0];
  twin.camera.camera_from_world.translation.x += 1e-4;
  capture.views.push_back(twin);
  const int32_t last = static_cast<int32_t>(capture.views.size()) - 1;
  const size_t sound = capture.points.size();
  for (int i = 0; i < 20; ++i)
    capture.points.push_back({{1e4, 10.0 * i, 1e5}, {}, 0, {0, last}});
  const Capture sure = WithParallax(capture, kLeastParallaxDeg);
  EXPECT_EQ(sure.points.size(), sound);
  EXPECT_EQ(sure.views.size(), capture.views.size());
  const Capture distant = CaptureOf({.points = 200, .arc_deg = 1});
  EXPECT_EQ(WithParallax(distant, kLeastParallaxDeg).points.size(), distant.points.size());
}

}  // namespace
}  // namespace regrade
