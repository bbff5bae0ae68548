// Photos of more than 8 bits, from the file to what a fit and COLMAP read.
#include <gtest/gtest.h>

#include "pipeline/capture/colmap_photos.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/working_views.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::Photo;
using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

class PhotoBits : public ::testing::Test {
 protected:
  PhotoBits() { fs::create_directory(folder_); }
  IngestResult Ingest() { return IngestPhotos(folder_, staging_, {}, {}); }

  TemporaryFolder scratch_;
  std::string folder_ = scratch_ / "photos", staging_ = scratch_ / "out/poses/photos";
};

// An uncompressed RGB TIFF of 16 bits a channel.
std::string WideTiff(const Image& image) {
  using testing::Little, testing::TiffEntry;
  const uint32_t bytes = static_cast<uint32_t>(image.pixels.size() * 2);
  std::string tiff = "II*" + std::string(1, 0) + Little(8, 4) + Little(9, 2);
  const uint32_t extra = 8 + 2 + 9 * 12 + 4;
  tiff += TiffEntry(256, 3, 1, static_cast<uint32_t>(image.width)) +
          TiffEntry(257, 3, 1, static_cast<uint32_t>(image.height)) +
          TiffEntry(258, 3, 3, extra) + TiffEntry(259, 3, 1, 1) + TiffEntry(262, 3, 1, 2) +
          TiffEntry(273, 4, 1, extra + 6) + TiffEntry(277, 3, 1, 3) +
          TiffEntry(278, 3, 1, static_cast<uint32_t>(image.height)) +
          TiffEntry(279, 4, 1, bytes) + Little(0, 4) + Little(16, 2) + Little(16, 2) +
          Little(16, 2);
  for (const float v : image.pixels)
    tiff += Little(static_cast<uint64_t>(v * 65535.f + 0.5f), 2);
  return tiff;
}

// A picture whose values are exact in 16 bits and not in 8.
Image WidePhoto(int seed) {
  Image image = Photo(96, 64, static_cast<uint64_t>(seed));
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const int level = static_cast<int>(image.pixels[i] * 65535.f);
    image.pixels[i] =
        static_cast<float>(level / 257 * 257 + static_cast<int>(i % 100)) / 65535.f;
  }
  return image;
}

CaptureView ViewOf(const StagedPhoto& photo) {
  CaptureView view{photo.name, photo.file, photo.path, {}};
  view.camera.width = photo.width, view.camera.height = photo.height;
  return view;
}

TEST_F(PhotoBits, SixteenReachTheFit) {
  WriteText(folder_ + "/a.png", EncodePng16(WidePhoto(1)));
  WriteText(folder_ + "/b.tif", WideTiff(WidePhoto(2)));
  WriteText(folder_ + "/c.png", EncodePng8(Photo(96, 64, 3)));
  WriteText(folder_ + "/d.tif", testing::FloatTiff(WidePhoto(4)));
  const IngestResult result = Ingest();
  ASSERT_EQ(result.photos.size(), 4u);
  Capture capture;
  for (const StagedPhoto& photo : result.photos) capture.views.push_back(ViewOf(photo));
  const WorkingViews views(capture, 800, 0);
  const int bits[] = {16, 16, 8, 16};
  for (int i = 0; i < 4; ++i) {
    const StagedPhoto& photo = result.photos[static_cast<size_t>(i)];
    EXPECT_EQ(photo.bits, bits[i]) << photo.file;
    EXPECT_EQ(DecodePhoto(photo.path).bits, bits[i]) << photo.file;
    const Image before = DecodePhoto(folder_ + "/" + photo.file).image, after = views.Photo(i);
    ASSERT_EQ(after.pixels.size(), before.pixels.size());
    // Half a level of 16 bits, for the photo in floats; the others are exact.
    for (size_t k = 0; k < before.pixels.size(); ++k)
      ASSERT_NEAR(after.pixels[k], before.pixels[k], i == 3 ? 0.51 / 65535 : 0) << photo.file;
  }
  // 8-bit photos are staged as ever.
  EXPECT_EQ(ReadText(result.photos[2].path), EncodePng8(Photo(96, 64, 3)));
  // The same picture in 8 bits is another one, and the other way round.
  const Image rounded = ReadImage(folder_ + "/c.png");
  WriteText(folder_ + "/c.png", EncodePng16(rounded));
  EXPECT_EQ(DecodePhoto(Ingest().photos[2].path).bits, 16);
  WriteText(folder_ + "/c.png", EncodePng8(rounded));
  EXPECT_EQ(DecodePhoto(Ingest().photos[2].path).bits, 8);
}

TEST_F(PhotoBits, APhotoIsDecodedOnceForAllStages) {
  for (int i = 0; i < 3; ++i)
    WriteText(folder_ + "/p" + std::to_string(i) + ".png", EncodePng16(WidePhoto(i)));
  Capture capture;
  for (const StagedPhoto& photo : Ingest().photos) capture.views.push_back(ViewOf(photo));
  Camera& lens = capture.views[1].camera;  // undistorted behind what is kept
  lens.fx = lens.fy = 96, lens.cx = 48, lens.cy = 32;
  lens.lens = LensModel::kOpenCv, lens.distortion = {0.2};
  constexpr int kSize = 40, kBytes = 40 * 27 * 3 * 4;
  const WorkingViews plain(capture, kSize, 0);
  const auto kept = std::make_shared<KeptPhotos>(2 * kBytes);  // the third has no room
  for (int stage = 0; stage < 3; ++stage) {
    const WorkingViews views = WorkingViews(capture, kSize, 0).KeepingPhotos(kept);
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(views.Photo(i).pixels, plain.Photo(i).pixels);
      EXPECT_EQ(views.Pinholes().Photo(i).pixels, plain.Pinholes().Photo(i).pixels);
    }
  }
  EXPECT_EQ(kept->decoded(), 1 + 1 + 6);
  EXPECT_EQ(kept->taken(), 5 + 5);
  EXPECT_NE(plain.AtSize(20).KeepingPhotos(kept).Photo(0).width, kSize);
  fs::remove(capture.views[2].path);
  EXPECT_NO_THROW(plain.KeepingPhotos(kept).Photo(0));
  EXPECT_THROW(plain.KeepingPhotos(kept).Photo(2), Error);
}

TEST_F(PhotoBits, ColmapGetsEight) {
  for (int i = 0; i < 3; ++i)
    WriteText(folder_ + "/p" + std::to_string(i) + ".jpg",
              EncodeJpeg(Photo(96, 64, static_cast<uint64_t>(i)), 90));
  const std::string copies = scratch_ / "copies";
  IngestResult result = Ingest();
  EXPECT_EQ(PhotosForColmap(result.photos, copies)[0].path, result.photos[0].path);
  EXPECT_FALSE(fs::exists(copies));
  WriteText(folder_ + "/p1.jpg", EncodePng16(WidePhoto(1)));
  result = Ingest();
  const std::vector<StagedPhoto> photos = PhotosForColmap(result.photos, copies);
  ASSERT_EQ(photos.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(photos[i].name, result.photos[i].name);
    EXPECT_EQ(photos[i].path, copies + "/" + photos[i].name);
    EXPECT_EQ(ReadText(photos[i].path), EncodePng8(ReadImage(result.photos[i].path)));
  }
}

}  // namespace
}  // namespace regrade
