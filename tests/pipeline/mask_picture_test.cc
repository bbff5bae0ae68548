// Masks as programs write them: in colour, in alpha, as cut-outs, as zeros and ones; and their
// names where photos are in several folders.
#include "pipeline/capture/mask_picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/capture/object_masks.h"
#include "pipeline/capture/photo_masks.h"
#include "pipeline/capture/photo_names.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::TemporaryFolder;
using testing::WriteText;

constexpr int kWidth = 32, kHeight = 24;

// The left half has the first values, the right half the second ones.
Image Halves(const std::vector<float>& left, const std::vector<float>& right) {
  Image image(kWidth, kHeight, static_cast<int>(left.size()));
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x)
      std::ranges::copy(x < kWidth / 2 ? left : right, image.at(x, y));
  return image;
}

class MaskPicture : public ::testing::Test {
 protected:
  MaskPicture() { fs::create_directories(folder_ / "m"); }
  std::string Write(const Image& image) const {
    WritePng8(folder_ / "m/a.png", image);
    return folder_ / "m/a.png";
  }
  // What --photo-masks makes of it.
  Image Staged() const {
    StagedPhoto photo;
    photo.file = "a.jpg";
    photo.name = "00000.png";
    photo.width = kWidth, photo.height = kHeight;
    EXPECT_EQ(StagePhotoMasks(folder_ / "m", {photo}, folder_ / "staged"), 1);
    return ReadImage(folder_ / "staged/00000.png.png");
  }
  // What --masks makes of it.
  Image Object() const {
    MaskOptions options{.masks = folder_ / "m"};
    return ObjectMasks(options, {"a.jpg"}).Coverage(0, kWidth, kHeight).at(0);
  }
  TemporaryFolder folder_;
};

TEST_F(MaskPicture, ColourAndAlphaCountAlikeForBothKindsOfMasks) {
  for (const auto& [left, right] :
       std::vector<std::pair<std::vector<float>, std::vector<float>>>{
           {{0}, {1}},
           {{0, 0, 0}, {1, 1, 1}},
           {{1, 1, 1, 0}, {1, 1, 1, 1}},                       // white, the mask in alpha
           {{0, 0, 0, 1}, {1, 1, 1, 1}},                       // opaque
           {{0.2f, 0.4f, 0.1f, 0}, {0.2f, 0.4f, 0.1f, 1}}}) {  // a dark photo that was cut out
    const std::string path = Write(Halves(left, right));
    for (const Image& mask : {ReadMask(path), Staged(), Object()}) {
      ASSERT_EQ(mask.channels, 1);
      EXPECT_EQ(*mask.at(3, 3), 0);
      EXPECT_EQ(*mask.at(kWidth - 3, 3), 1);
    }
  }
}

TEST_F(MaskPicture, SoftEdgesAreTheProduct) {
  const Image mask = ReadMask(Write(Halves({1, 1, 1, 0.2f}, {0.4f, 0.4f, 0.4f, 1})));
  EXPECT_NEAR(*mask.at(0, 0), 0.2, 1e-6);
  EXPECT_NEAR(*mask.at(kWidth - 1, 0), 0.4, 1e-6);
}

TEST_F(MaskPicture, MasksOfZeroAndOneAreRefused) {
  const std::string path = Write(Halves({0}, {1.0f / 255}));
  EXPECT_REGRADE_ERROR(ReadMask(path), ExitCode::kInput, "largest value is 1 of 255");
  EXPECT_REGRADE_ERROR(Staged(), ExitCode::kInput, "write 255 for white");
  EXPECT_REGRADE_ERROR(Object(), ExitCode::kInput, "write 255 for white");
  // A black picture with a little noise is a mask: the object is not in that photo.
  Image noise(2 * kWidth, 2 * kHeight, 1);
  std::fill_n(noise.pixels.begin(), 3, 1.0f / 255);
  EXPECT_EQ(ReadMask(Write(noise)).pixels, noise.pixels);
  // A photo of which nothing is kept.
  Write(Image(kWidth, kHeight, 1));
  EXPECT_REGRADE_ERROR(Staged(), ExitCode::kInput, "entirely black");
  Write(Halves({0}, {0.3f}));
  EXPECT_REGRADE_ERROR(Staged(), ExitCode::kInput, "largest value is 77 of 255");
}

class MaskNames : public ::testing::Test {
 protected:
  void Put(const std::vector<std::string>& names) const {
    for (const std::string& name : names) WriteText(folder_ / ("m/" + name), "x");
  }
  std::vector<std::string> Found(const std::vector<std::string>& photos) const {
    std::vector<std::string> names;
    const fs::path root = fs::canonical(folder_ / "m");
    for (const std::string& path : PicturesByPhotoName(folder_ / "m", photos, "mask"))
      names.push_back(path.empty() ? "" : fs::path(path).lexically_relative(root).string());
    return names;
  }
  TemporaryFolder folder_;
};

using Paths = std::vector<std::string>;

TEST_F(MaskNames, OfSeveralCamerasAreFoundByTheirFolders) {
  Put({"cam0/0.jpg.png", "cam1/0.jpg.png", "cam1/1.heic.png", "only.png"});
  EXPECT_EQ(Found({"cam0/0.jpg", "cam1/0.jpg", "cam1/1.HEIC", "cam0/only.jpg"}),
            (Paths{"cam0/0.jpg.png", "cam1/0.jpg.png", "cam1/1.heic.png", "only.png"}));
  // PHOTOS may be the folder above that of the pictures.
  EXPECT_EQ(Found({"images/cam1/0.jpg", "images/cam0/0.jpg"}),
            (Paths{"cam1/0.jpg.png", "cam0/0.jpg.png"}));
}

TEST_F(MaskNames, APathCountsMoreThanABareName) {
  Put({"0.png", "a/0.png", "b/0.png"});
  EXPECT_EQ(Found({"a/0.jpg", "0.jpg"}), (Paths{"a/0.png", "0.png"}));
  Put({"1.png"});
  EXPECT_EQ(Found({"a/0.jpg", "x/1.jpg"}), (Paths{"a/0.png", "1.png"}));
}

TEST_F(MaskNames, ANameThatMayBeOfTwoPhotosIsRefused) {
  Put({"cam0/0.png", "0.png"});
  EXPECT_REGRADE_ERROR(Found({"cam0/0.jpg", "cam1/0.jpg"}), ExitCode::kInput, "cam1/0.jpg");
  Put({"cam1/0.png"});
  EXPECT_EQ(Found({"cam0/0.jpg", "cam1/0.jpg"}), (Paths{"cam0/0.png", "cam1/0.png"}))
      << "each has its own";
  Put({"cam1/0.tif"});
  EXPECT_REGRADE_ERROR(Found({"cam0/0.jpg", "cam1/0.jpg"}), ExitCode::kInput, "two masks");
}

}  // namespace
}  // namespace regrade
