// Checks of reliable and unreliable scene geometry.
#include "reconstruct/scene/scene_checks.h"

#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/colmap/colmap_model.h"
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

}  // namespace
}  // namespace regrade
