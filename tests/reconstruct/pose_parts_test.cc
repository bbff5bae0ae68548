// The parts of the search for poses: strategies, COLMAP's output, and the final adjustment.
#include <gtest/gtest.h>

#include "reconstruct/colmap/colmap_output.h"
#include "reconstruct/colmap/colmap_strategies.h"
#include "reconstruct/colmap/refine_intrinsics.h"
#include "tests/support/synthetic_model.h"

namespace regrade {
namespace {

using testing::MakeSyntheticModel;

TEST(PoseStrategies, CostIncreases) {
  std::vector<StagedPhoto> photos(50);
  for (StagedPhoto& photo : photos) photo.width = 1920, photo.height = 1080;
  const std::vector<PoseStrategy> strategies = PoseStrategies(photos, 30);
  EXPECT_EQ(strategies[0].pairing, Pairing::kOrder);
  EXPECT_EQ(strategies[0].first_octave, 0);
  EXPECT_GT(strategies[1].max_features, strategies[0].max_features);
  EXPECT_TRUE(strategies[2].keep_matches);
  EXPECT_EQ(strategies.back().pairing, Pairing::kAll);
  photos.resize(11);
  EXPECT_EQ(PoseStrategies(photos, 30)[0].pairing, Pairing::kAll);
  EXPECT_EQ(PoseStrategies(photos, 30)[0].lens, ColmapLens::kSimpleRadial);
}

TEST(PoseStrategies, OneOfVeryManyPhotosHasFewerFeatures) {
  std::vector<StagedPhoto> photos(500);
  for (StagedPhoto& photo : photos) photo.width = 1920, photo.height = 1080;
  const PoseStrategy many = PoseStrategies(photos, 30)[0];
  EXPECT_EQ(many.pairing, Pairing::kSimilar);
  photos.resize(501, photos[0]);
  const std::vector<PoseStrategy> very_many = PoseStrategies(photos, 30);
  EXPECT_LT(very_many[0].max_features, many.max_features);
  for (const PoseStrategy& strategy : very_many) EXPECT_NE(strategy.pairing, Pairing::kAll);
}

TEST(PoseStrategies, H148_MixedSizesAndFocalLengthsHaveTheirOwnCameras) {
  std::vector<StagedPhoto> photos = {{"a", "0", "", 640, 480, 0},
                                     {"b", "1", "", 480, 640, 0},
                                     {"c", "2", "", 640, 480, 0},
                                     {"d", "3", "", 640, 480, 700}};
  const std::vector<CameraGroup> groups = GroupByCamera(photos);
  ASSERT_EQ(groups.size(), 3u);
  EXPECT_EQ(groups[0].names, (std::vector<std::string>{"0", "2"}));
  const ColmapArguments arguments = ExtractArguments({}, groups[2], 1000, 0, {});
  EXPECT_EQ(arguments.back().first, "ImageReader.camera_params");
  EXPECT_EQ(arguments.back().second, "700,700,320,240,0,0,0,0");
}

TEST(ColmapOutput, ReadsProgressAndEvidence) {
  ColmapOutput output(10);
  output.Line("Processed file [3/12]");
  EXPECT_DOUBLE_EQ(output.fraction(), 0.25);
  output.Line("  Name:            a b.png");
  output.Line("  Features:        1398");
  output.StartCommand();
  output.Line("Matching block [2/2, 1/2] in 1.9s");
  EXPECT_DOUBLE_EQ(output.fraction(), 0.75);
  output.StartCommand();
  output.Line("I20250101 12:00:00 mapper.cc:1] Registering image #7 (5)");
  EXPECT_DOUBLE_EQ(output.fraction(), 0.5);
  output.Line("Loading matches... 41 in 0.000s");
  output.Line("Matching block [x/0, 1");
  output.Line("Processed file [5/0]");
  EXPECT_DOUBLE_EQ(output.fraction(), 0.5);
  EXPECT_EQ(output.evidence().features.at("a b.png"), 1398);
  EXPECT_EQ(output.evidence().matched_pairs, 41);
}

TEST(RefineIntrinsics, RemovesOutliersAndPointsWithoutObservations) {
  ColmapModel model = MakeSyntheticModel({.images = 5, .points = 30});
  for (ColmapImage& image : model.images)
    for (ColmapKeypoint& keypoint : image.keypoints) keypoint.u += 0.2;  // an error of all
  model.images[2].keypoints[7].v += 3;
  for (int i = 0; i < 4; ++i) model.images[i].keypoints[9].v += 3;
  const ColmapModel cleaned = WithoutOutliers(model, model, 2.5);
  EXPECT_EQ(cleaned.points.size(),
            29u);  // point 10 would keep one observation, so it is removed
  EXPECT_EQ(cleaned.FindPoint(10), nullptr);
  EXPECT_EQ(cleaned.FindPoint(8)->track.size(), 4u);
  EXPECT_EQ(cleaned.images[2].keypoints[7].point_id, kNoColmapPoint);
  EXPECT_EQ(cleaned.images[4].keypoints[9].point_id, kNoColmapPoint);
  EXPECT_EQ(cleaned.images[0].keypoints[7].point_id, 8u);
  EXPECT_NEAR(MeanSquaredReprojection(cleaned), 0.04, 1e-9);
}

TEST(RefineIntrinsics, WithLensKeepsCommonCoefficients) {
  ColmapModel model = MakeSyntheticModel({});
  model.cameras[0].intrinsics.distortion[0] = 0.1;
  EXPECT_EQ(WithLens(model, ColmapLens::kOpenCv).cameras[0].intrinsics.distortion[0], 0.1);
  const ColmapModel pinhole = WithLens(model, ColmapLens::kPinhole);
  EXPECT_EQ(pinhole.cameras[0].intrinsics.MaxCornerDistortion(), 0);
  EXPECT_EQ(pinhole.cameras[0].intrinsics.fx, 600);
}

}  // namespace
}  // namespace regrade
