// Photos with EXIF orientation and given poses: the reading that the points agree with.
#include "pipeline/capture/posed_orientation.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/images/normalize_photo.h"
#include "tests/support/synthetic_photos.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;

class PosedOrientation : public ::testing::Test {
 protected:
  // A workspace whose poses are of the pictures as stored; photos staged upright.
  void Make(int orientation, int width, int height) {
    testing::WriteSyntheticWorkspace(
        {.views = 4, .width = width, .height = height, .effects = {}}, folder_ / "w");
    model_ = ReadColmapModel(folder_ / "w/sparse/0");
    photos_.clear();
    for (ColmapImage& image : model_.images) {
      const std::string path = folder_ / ("w/images/" + image.name);
      stored_ = ReadImage(path);
      const Image upright = Upright(stored_, orientation);
      WritePng8(path, upright);
      photos_.push_back(
          {image.name, image.name, path, upright.width, upright.height, 0, 8, -1, orientation});
    }
  }

  // Mean difference of pictures and the points' colours in one reading, by their observations.
  void ExpectPointsOnTheirColors() const {
    const Capture capture = CaptureFromModel(model_, photos_);
    ASSERT_EQ(capture.views.size(), 4u);
    double sum = 0, count = 0;
    std::vector<Image> pictures;
    for (const CaptureView& view : capture.views) pictures.push_back(ReadImage(view.path));
    for (const ScenePoint& point : capture.points) {
      Vec3d mean{}, squares{};
      for (const int32_t v : point.views) {
        const Image& picture = pictures[static_cast<size_t>(v)];
        double x = 0, y = 0;
        ASSERT_TRUE(
            capture.views[static_cast<size_t>(v)].camera.Project(point.position, &x, &y));
        const float* pixel = picture.at(std::clamp(static_cast<int>(x), 0, picture.width - 1),
                                        std::clamp(static_cast<int>(y), 0, picture.height - 1));
        for (int c = 0; c < 3; ++c) {
          mean[c] += pixel[c];
          squares[c] += pixel[c] * pixel[c];
        }
      }
      const double n = static_cast<double>(point.views.size());
      for (int c = 0; c < 3; ++c) sum += squares[c] / n - mean[c] * mean[c] / (n * n);
      count += 3;
    }
    // Wrong readings have the variance of the scene, above 0.02.
    EXPECT_LT(sum / count, 0.01);
    EXPECT_LT(capture.reprojection_px, 1e-6);
  }

  TemporaryFolder folder_;
  ColmapModel model_;
  std::vector<StagedPhoto> photos_;
  Image stored_;  // the last picture
};

TEST_F(PosedOrientation, PointsTellWherePicturesHaveOneSizeEitherWay) {
  for (int orientation = 2; orientation <= 8; ++orientation) {
    Make(orientation, 120, orientation < 5 ? 90 : 120);
    const std::string said = MatchOrientations(&model_, &photos_);
    EXPECT_NE(said.find("4 photos have an EXIF orientation"), std::string::npos) << said;
    EXPECT_NE(said.find("points' colours"), std::string::npos) << said;
    EXPECT_NE(said.find("as stored"), std::string::npos) << said;
    ExpectPointsOnTheirColors();
  }
}

TEST_F(PosedOrientation, SizesTellWhereTheyDiffer) {
  for (const int orientation : {5, 6, 7, 8}) {
    Make(orientation, 120, 90);
    const std::string said = MatchOrientations(&model_, &photos_);
    EXPECT_NE(said.find("cameras' sizes"), std::string::npos) << said;
    ExpectPointsOnTheirColors();
    EXPECT_EQ(photos_[0].width, orientation == 6 || orientation == 8 ? 90 : 120);
  }
}

// As by COLMAP 4: tags on pictures whose poses are of the upright ones.
TEST_F(PosedOrientation, PosesOfUprightPicturesStay) {
  Make(1, 120, 90);
  for (StagedPhoto& photo : photos_) photo.orientation = 3;
  const std::string said = MatchOrientations(&model_, &photos_);
  EXPECT_NE(said.find("turned upright"), std::string::npos) << said;
  EXPECT_EQ(said.find("as stored"), std::string::npos) << said;
  ExpectPointsOnTheirColors();
}

TEST_F(PosedOrientation, WithoutPointsPosesAreOfTheStoredPictures) {
  Make(2, 120, 90);
  model_.points.clear();
  for (ColmapImage& image : model_.images) image.keypoints.clear();
  const std::string said = MatchOrientations(&model_, &photos_);
  EXPECT_NE(said.find("as stored"), std::string::npos) << said;
  EXPECT_EQ(ReadImage(photos_.back().path).pixels, stored_.pixels);
  Make(1, 120, 90);
  EXPECT_EQ(MatchOrientations(&model_, &photos_), "");
}

}  // namespace
}  // namespace regrade
