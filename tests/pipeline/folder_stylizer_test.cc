#include "pipeline/stages/folder_stylizer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

Image Constant(int width, int height, float red) {
  Image image(width, height);
  for (int64_t i = 0; i < image.num_pixels(); ++i) image.pixels[3 * i] = red;
  return image;
}

const std::vector<std::string> kPhotos = {"a/IMG_1.JPG", "IMG_2.jpg", "b/IMG.3.png"};

TEST(FolderStylizer, PicturesAreFoundByNameAndBroughtToTheViewsSize) {
  const testing::TemporaryFolder folder;
  WritePng8(folder / "IMG_1.png", Constant(80, 60, 0.2f));
  WritePng8(folder / "IMG.3.png", Constant(20, 15, 0.4f));
  WritePng8(folder / "somebody_elses.png", Constant(7, 7, 1));
  testing::WriteText(folder / "IMG_9.txt", "not asked for");
  testing::WriteText(folder / "IMG_1.xmp", "an editor's notes");
  testing::WriteText(folder / "deep/IMG_2.xmp", "notes of a picture that is not there");
  const auto stylizer = MakeFolderStylizer(folder.path(), kPhotos);
  EXPECT_FALSE(stylizer->StylesAnything());
  EXPECT_TRUE(stylizer->Knows(0));
  EXPECT_FALSE(stylizer->Knows(1));
  EXPECT_TRUE(stylizer->Knows(2));
  EXPECT_FALSE(stylizer->Knows(3));
  ASSERT_EQ(stylizer->Notices().size(), 1u);
  EXPECT_NE(stylizer->Notices()[0].find("2 of 3"), std::string::npos);
  const Image view = Constant(40, 30, 0);
  for (const auto& [index, red] : {std::pair{0, 0.2f}, std::pair{2, 0.4f}}) {
    const Image styled = stylizer->Stylize(view, index);
    EXPECT_EQ(CheckStyledView(view, styled, "view"), 0);
    EXPECT_NEAR(styled.at(11, 7)[0], red, 1e-6);
  }
}

TEST(FolderStylizer, H27_AnotherAspectIsRefusedNotStretched) {
  const Image view(480, 271);  // of a photo of 4000 x 2255
  FittedToView(Image(4000, 2255), view, "x");
  FittedToView(Image(480, 272), view, "x");  // rounded the other way
  for (const Image& other : {Image(271, 480), Image(480, 280), Image(470, 271)})
    EXPECT_REGRADE_ERROR(FittedToView(other, view, "x.png"), ExitCode::kExternalProgram,
                         "x.png");
}

TEST(FolderStylizer, MistakesAreNamed) {
  const testing::TemporaryFolder folder;
  EXPECT_REGRADE_ERROR(MakeFolderStylizer(folder / "none", kPhotos), ExitCode::kInput, "none");
  EXPECT_REGRADE_ERROR(MakeFolderStylizer(folder.path(), kPhotos), ExitCode::kInput,
                       "IMG_1.png");
  testing::WriteText(folder / "IMG_2.png", "no picture");
  const auto stylizer = MakeFolderStylizer(folder.path(), kPhotos);
  EXPECT_REGRADE_ERROR(stylizer->Stylize(Image(8, 8), 1), ExitCode::kInput, "IMG_2.png");
  testing::WriteText(folder / "IMG_2.jpg", "another");
  EXPECT_REGRADE_ERROR(MakeFolderStylizer(folder.path(), kPhotos), ExitCode::kInput,
                       "two pictures");
  EXPECT_REGRADE_ERROR(MakeFolderStylizer(folder.path(), {"x/1.png", "y/1.jpg"}),
                       ExitCode::kInput, "two photos");
}

}  // namespace
}  // namespace regrade
