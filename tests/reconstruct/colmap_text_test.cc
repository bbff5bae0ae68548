// COLMAP's text models: read like binary ones; errors name the line.
#include "reconstruct/colmap/colmap_text.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

class ColmapText : public ::testing::Test {
 protected:
  ColmapText() : model_(testing::MakeSyntheticModel({.images = 3, .points = 4})) {}

  void ExpectRefusal(const std::string& part) const {
    EXPECT_REGRADE_ERROR(ReadColmapModel(folder_), ExitCode::kInput, part);
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

// As editors and other programs write it: a byte-order mark, carriage returns, signs, tabs.
TEST_F(ColmapText, MarksReturnsAndSignsAreRead) {
  WriteColmapText(model_, folder_);
  for (const char* name : {"cameras", "images", "points3D"}) {
    fs::remove(folder_ + "/" + name + ".bin");
    const std::string path = folder_ + "/" + name + ".txt";
    std::string text = "\xef\xbb\xbf", line_end = "\r\n";
    for (const char c : testing::ReadText(path)) c == '\n' ? text += line_end : text += c;
    testing::WriteText(path, text);
  }
  testing::WriteText(folder_ + "/cameras.txt",
                     "\xef\xbb\xbf"
                     "1\tSIMPLE_RADIAL +640 480\t+6e2 +320.5 240 -0.25\r\n");
  const ColmapModel read = ReadColmapModel(folder_);
  EXPECT_EQ(read.images.size(), model_.images.size());
  EXPECT_EQ(read.images[1].name, model_.images[1].name);
  EXPECT_EQ(read.images[1].keypoints.size(), model_.images[1].keypoints.size());
  EXPECT_EQ(read.cameras[0].intrinsics.width, 640);
  EXPECT_EQ(read.cameras[0].intrinsics.fx, 600);
  EXPECT_EQ(read.cameras[0].intrinsics.cx, 320.5);
  EXPECT_EQ(read.cameras[0].intrinsics.distortion[0], -0.25);
  testing::WriteText(folder_ + "/cameras.txt", "1 SIMPLE_RADIAL 640 480 +-6 320 240 0\n");
  ExpectRefusal("'+-6'");
}

TEST_F(ColmapText, ImagesAreCountedWithoutReadingThem) {
  for (const int images : {1, 3}) {
    model_ = testing::MakeSyntheticModel({.images = images, .points = 4});
    model_.images.back().keypoints.clear();
    WriteColmapText(model_, folder_);
    EXPECT_EQ(CountColmapImages(folder_), static_cast<uint64_t>(images));
  }
  WriteColmapModel(testing::MakeSyntheticModel({.images = 5, .points = 4}), folder_);
  EXPECT_EQ(CountColmapImages(folder_), 5u) << "binary comes first";
  fs::resize_file(folder_ + "/images.bin", 100);
  EXPECT_EQ(CountColmapImages(folder_), 0u);
  EXPECT_EQ(CountColmapImages(folder_ + "/none"), 0u);
}

// A camera model that is not known is a newer COLMAP's, not damage.
TEST_F(ColmapText, ModelsOfANewerColmap) {
  WriteColmapText(model_, folder_);
  for (const char* name : {"cameras", "images", "points3D"})
    fs::remove(folder_ + "/" + name + ".bin");
  for (const char* lens : {"SIMPLE_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE", "EUCM_2"}) {
    testing::WriteText(folder_ + "/cameras.txt", Concat("1 ", lens, " 640 480 600 320 240\n"));
    EXPECT_REGRADE_ERROR(ReadColmapModel(folder_), ExitCode::kInput,
                         folder_ + "/cameras.txt: ", lens, "newer COLMAP", "OPENCV_FISHEYE");
  }
  testing::WriteText(folder_ + "/cameras.txt", "1 P!NHOLE 640 480 600 320 240\n");
  ExpectRefusal("damaged");
  testing::WriteText(folder_ + "/cameras.txt", "1 FOV 640 480 600 600 320 240 1\n");
  ExpectRefusal("cameras.txt");  // the file that was read
}

TEST_F(ColmapText, F58_DamagedTextIsRefusedWithItsLine) {
  WriteColmapText(model_, folder_);
  for (const char* name : {"cameras", "images", "points3D"})
    fs::remove(folder_ + "/" + name + ".bin");
  const std::string cameras = testing::ReadText(folder_ + "/cameras.txt");
  testing::WriteText(folder_ + "/cameras.txt",
                     "# a comment\n1 PINHOLE 640 480 nonsense 600 320 240\n");
  ExpectRefusal("line 2 has 'nonsense'");
  testing::WriteText(folder_ + "/cameras.txt", "1 PANORAMA 640 480 600 320 240\n");
  ExpectRefusal("unknown camera model 'PANORAMA'");
  testing::WriteText(folder_ + "/cameras.txt", "1 PINHOLE 640\n");
  ExpectRefusal("line 1 ends before a height");
  testing::WriteText(folder_ + "/cameras.txt", "1 PINHOLE 640 480 nan 600 320 240\n");
  ExpectRefusal("");
}

}  // namespace
}  // namespace regrade
