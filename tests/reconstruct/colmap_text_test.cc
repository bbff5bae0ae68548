// COLMAP's text models: read like binary ones; errors name the line.
#include "reconstruct/colmap/colmap_text.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

class ColmapText : public ::testing::Test {
 protected:
  ColmapText() : model_(testing::MakeSyntheticModel({.images = 3, .points = 4})) {}

  // The message of the refusal; fails the test if the model is accepted.
  std::string Refusal() const {
    try {
      ReadColmapModel(folder_);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
      return error.what();
    }
    ADD_FAILURE() << "accepted";
    return "";
  }

  testing::TemporaryFolder scratch_;
  std::string folder_ = scratch_.path();
  ColmapModel model_;
};

// Text files are read where there is no .bin; numbers are bitwise equal, up to rounding of the
// quaternions.
TEST_F(ColmapText, TextIsReadLikeBinary) {
  for (ColmapImage& image : model_.images) image.name = "a name with spaces/" + image.name;
  WriteColmapModel(model_, folder_);
  const ColmapModel binary = ReadColmapModel(folder_);
  for (const char* name : {"cameras", "images", "points3D"})
    fs::remove(folder_ + "/" + name + ".bin");
  WriteColmapText(model_, folder_);
  const ColmapModel text = ReadColmapModel(folder_);
  ASSERT_EQ(text.images.size(), binary.images.size());
  ASSERT_EQ(text.points.size(), binary.points.size());
  EXPECT_EQ(text.cameras[0].intrinsics.fx, binary.cameras[0].intrinsics.fx);
  EXPECT_EQ(text.cameras[0].lens, binary.cameras[0].lens);
  for (size_t i = 0; i < text.images.size(); ++i) {
    EXPECT_EQ(text.images[i].name, binary.images[i].name);
    EXPECT_EQ(text.images[i].camera_from_world.translation,
              binary.images[i].camera_from_world.translation);
    ASSERT_EQ(text.images[i].keypoints.size(), binary.images[i].keypoints.size());
    for (size_t k = 0; k < text.images[i].keypoints.size(); ++k) {
      EXPECT_EQ(text.images[i].keypoints[k].u, binary.images[i].keypoints[k].u);
      EXPECT_EQ(text.images[i].keypoints[k].point_id, binary.images[i].keypoints[k].point_id);
    }
  }
  for (size_t p = 0; p < text.points.size(); ++p) {
    EXPECT_EQ(text.points[p].position, binary.points[p].position);
    EXPECT_EQ(text.points[p].color, binary.points[p].color);
    EXPECT_EQ(text.points[p].track.size(), binary.points[p].track.size());
  }
}

TEST_F(ColmapText, F58_DamagedTextIsRefusedWithItsLine) {
  WriteColmapText(model_, folder_);
  for (const char* name : {"cameras", "images", "points3D"})
    fs::remove(folder_ + "/" + name + ".bin");
  const std::string cameras = testing::ReadText(folder_ + "/cameras.txt");
  testing::WriteText(folder_ + "/cameras.txt",
                     "# a comment\n1 PINHOLE 640 480 nonsense 600 320 240\n");
  EXPECT_NE(Refusal().find("line 2 has 'nonsense'"), std::string::npos);
  testing::WriteText(folder_ + "/cameras.txt", "1 PANORAMA 640 480 600 320 240\n");
  EXPECT_NE(Refusal().find("unknown camera model 'PANORAMA'"), std::string::npos);
  testing::WriteText(folder_ + "/cameras.txt", "1 PINHOLE 640\n");
  EXPECT_NE(Refusal().find("line 1 ends before a height"), std::string::npos);
  testing::WriteText(folder_ + "/cameras.txt", "1 PINHOLE 640 480 nan 600 320 240\n");
  Refusal();
  testing::WriteText(folder_ + "/cameras.txt", cameras);
  const std::string images = testing::ReadText(folder_ + "/images.txt");
  // Truncated anywhere: an error or fewer images, never a crash.
  for (size_t cut = 0; cut < images.size(); cut += 7) {
    testing::WriteText(folder_ + "/images.txt", images.substr(0, cut));
    try {
      ReadColmapModel(folder_);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
    }
  }
}

}  // namespace
}  // namespace regrade
