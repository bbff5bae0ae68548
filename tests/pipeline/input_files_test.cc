// Folders as cameras and phones leave them: which files are taken, and what is said.
#include "pipeline/capture/input_files.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/capture/ingest_photos.h"
#include "tests/pipeline/clip_file.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::Photo;
using testing::TemporaryFolder;
using testing::WriteClip;
using testing::WriteText;

class InputFolder : public ::testing::Test {
 protected:
  InputFolder() { std::filesystem::create_directories(folder_); }
  void PutPhoto(const std::string& name, int width = 400, int height = 300) {
    WriteText(folder_ + "/" + name, EncodeJpeg(Photo(width, height, seed_++), 90));
  }
  void PutClip(const std::string& name, int frames) {
    std::vector<Image> pictures;
    for (int i = 0; i < frames; ++i) pictures.push_back(Photo(160, 96, seed_++));
    WriteClip(folder_ + "/" + name, pictures);
  }
  std::string WhyLeft(const InputFiles& inputs, const std::string& name) {
    for (const InputFile& input : inputs.files)
      if (input.file.name == name)
        return input.kind == InputKind::kLeft   ? input.why
               : input.kind == InputKind::kClip ? "film"
                                                : "photo";
    return "not listed";
  }
  IngestResult Ingest() { return IngestPhotos(folder_, scratch_ / "out", {}, {}); }

  TemporaryFolder scratch_;
  const std::string folder_ = scratch_ / "in";
  uint64_t seed_ = 1;
};

TEST_F(InputFolder, F92_LiveClipsSidecarsAndSmallCopiesAreLeft) {
  for (const char* name : {"IMG_1.JPG", "IMG_2.JPG", "IMG_3.JPG", "sub/IMG_1.JPG"})
    PutPhoto(name);
  PutClip("IMG_1.MOV", 20);
  PutClip("IMG_2.MOV", 200);  // 8 s: no live photo
  PutClip("other.mp4", 20);
  PutClip("GOPR1.LRV", 20);
  PutPhoto("GOPR1.THM", 160, 120);
  for (const char* name : {"IMG_1.AAE", "IMG_1.xmp", "IMG_2.JPG.json"})
    WriteText(folder_ + "/" + name, "<sidecar/>");
  const InputFiles inputs = ListInputs(folder_);
  EXPECT_EQ(WhyLeft(inputs, "IMG_1.MOV"), "the live-photo clip of IMG_1.JPG");
  EXPECT_EQ(WhyLeft(inputs, "IMG_2.MOV"), "film");
  EXPECT_EQ(WhyLeft(inputs, "other.mp4"), "film");
  EXPECT_TRUE(Contains(WhyLeft(inputs, "GOPR1.LRV"), "small copy"));
  EXPECT_TRUE(Contains(WhyLeft(inputs, "GOPR1.THM"), "thumbnail"));
  EXPECT_EQ(WhyLeft(inputs, "IMG_1.JPG"), "photo");
  EXPECT_EQ(WhyLeft(ListInputs(folder_, false), "other.mp4"), "a film has no given poses");

  const IngestResult result = Ingest();
  EXPECT_EQ(testing::WhyNot(result, "IMG_1.AAE"), "not an image");
  EXPECT_TRUE(Contains(result.summary, "taken: 4 photos (400 x 300), ")) << result.summary;
  EXPECT_TRUE(Contains(result.summary, "frames of IMG_2.MOV")) << result.summary;
  EXPECT_TRUE(Contains(result.summary, "1 x live-photo clip")) << result.summary;
  EXPECT_TRUE(Contains(result.summary, "1 x no picture.AAE")) << result.summary;
  EXPECT_EQ(result.notices.size(), 2u) << "of the films; sidecars are left quietly";
}

TEST_F(InputFolder, F92_TwoCamerasAreCounted) {
  for (int i = 0; i < 3; ++i) PutPhoto("a" + std::to_string(i) + ".jpg");
  EXPECT_EQ(Ingest().summary, "") << "nothing to say of a plain folder";
  for (int i = 0; i < 2; ++i) PutPhoto("b" + std::to_string(i) + ".jpg", 300, 400);
  EXPECT_EQ(Ingest().summary, "taken: 5 photos (3 of 400 x 300, 2 of 300 x 400)");
}

TEST_F(InputFolder, F92_ThumbnailsAreLeftWhereverTheyStand) {
  const std::vector<std::string> names = {"a.jpg", "b.jpg", "c.jpg", "d.jpg"};
  for (const std::string& name : names) PutPhoto(name, 800, 600);
  for (const std::string& name : names) PutPhoto("a thumbs/" + name, 160, 120);
  Image cut_out = Photo(800, 600, 77, 4);
  WritePng8(folder_ + "/e.png", cut_out);
  const IngestResult result = Ingest();
  ASSERT_EQ(result.photos.size(), 5u);
  EXPECT_EQ(testing::WhyNot(result, "a thumbs/a.jpg"), "a thumbnail: 160 x 120");
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(result.photos[i].file, names[i]);
    EXPECT_EQ(result.photos[i].name, "0000" + std::to_string(i) + ".png");
    EXPECT_EQ(ReadImage(result.photos[i].path).pixels,
              DecodePhoto(folder_ + "/" + names[i]).image.pixels);
  }
  EXPECT_TRUE(std::filesystem::exists(scratch_ / "out/00004.alpha.png"));
  // Nothing else is left of the larger numbers.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch_ / "out"), {}), 6);
  EXPECT_EQ(Ingest().fingerprint, result.fingerprint);
}

TEST_F(InputFolder, F92_SmallPhotosAmongOthersAreKept) {
  for (int i = 0; i < 4; ++i) PutPhoto("a" + std::to_string(i) + ".jpg", 800, 600);
  for (int i = 0; i < 4; ++i) PutPhoto("b" + std::to_string(i) + ".jpg", 240, 180);
  EXPECT_EQ(Ingest().photos.size(), 8u);
}

TEST_F(InputFolder, F92_ARawFileBesideItsPictureIsLeft) {
  PutPhoto("DSC_1.JPG");
  for (const char* name : {"DSC_1.NEF", "DSC_2.NEF"})
    WriteText(folder_ + "/" + name, testing::FloatTiff(Photo(64, 64, 1)));
  const InputFiles inputs = ListInputs(folder_);
  EXPECT_EQ(WhyLeft(inputs, "DSC_1.NEF"), "the raw file of DSC_1.JPG");
  EXPECT_EQ(WhyLeft(inputs, "DSC_2.NEF"), "photo");
}

TEST_F(InputFolder, F92_APathMayBeAFilm) {
  PutClip("a.mp4", 3);
  const InputFiles inputs = ListInputs(folder_ + "/a.mp4");
  ASSERT_EQ(inputs.files.size(), 1u);
  EXPECT_EQ(inputs.files[0].kind, InputKind::kClip);
  EXPECT_EQ(inputs.files[0].file.name, "a.mp4");
  PutPhoto("b.jpg");
  WriteText(folder_ + "/empty.mp4", "");
  for (const char* name : {"b.jpg", "empty.mp4"}) {
    EXPECT_REGRADE_ERROR(ListInputs(folder_ + "/" + name), ExitCode::kInput,
                         folder_ + "/" + name + ": ");
  }
  EXPECT_EQ(PlannedInputs(ListInputs(folder_), {}),
            "2 files and 1 film (0.1 s), of which 40 to 120 frames are picked");
}

}  // namespace
}  // namespace regrade
