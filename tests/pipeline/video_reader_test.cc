// Films that are read: codecs, times, rotation, colours, and files that are no whole film.
#include "pipeline/images/video_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/pipeline/clip_file.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

using testing::ClipSpec;
using testing::Contains;
using testing::MeanDifference;
using testing::ReadText;
using testing::WriteClip;

// Smooth, so that chroma at half resolution loses little; a bright square in the top left
// corner, and a bar that moves with the frame's number.
Image FilmFrame(int width, int height, int number) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      float* p = image.at(x, y);
      p[0] = 0.2f + 0.3f * static_cast<float>(x) / static_cast<float>(width);
      p[1] = 0.3f + 0.2f * static_cast<float>(y) / static_cast<float>(height);
      p[2] = 0.35f;
      if (x < width / 4 && y < height / 4) p[0] = p[1] = p[2] = 0.95f;
      if (y > 3 * height / 4 && x / 8 == number % (width / 8)) p[0] = p[1] = p[2] = 0.05f;
    }
  return image;
}

std::vector<Image> FilmFrames(int count, int width = 160, int height = 96) {
  std::vector<Image> frames;
  for (int i = 0; i < count; ++i) frames.push_back(FilmFrame(width, height, i));
  return frames;
}

class VideoReaderTest : public testing::PictureTest {
 protected:
  // The reason of a refusal, at opening or later; "" for a film that is read to its end.
  std::string RefusalOf(const std::string& path, const VideoLimits& limits = {}) {
    try {
      VideoReader reader(path, limits);
      frames_ = 0;
      while (reader.Next()) ++frames_;
      damaged_ = reader.damaged();
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kInput);
      EXPECT_EQ(error.where(), path);
      return error.what_failed();
    }
  }
  int frames_ = 0;
  int64_t damaged_ = 0;
};

TEST_F(VideoReaderTest, F90_FramesComeInOrderWithTheirColours) {
  for (const ClipSpec& spec :
       {ClipSpec{}, ClipSpec{.encoder = "libx265"}, ClipSpec{.container = "mov"},
        ClipSpec{.container = "matroska"}}) {
    const std::vector<Image> frames = FilmFrames(30);
    const std::string path = scratch_ / "film";
    if (!WriteClip(path, frames, spec)) continue;
    VideoReader reader(path);
    EXPECT_EQ(reader.info().width, 160);
    EXPECT_EQ(reader.info().height, 96);
    EXPECT_NEAR(reader.info().seconds, 30 / 25.0, 0.09) << spec.container;
    for (size_t i = 0; i < frames.size(); ++i) {
      ASSERT_TRUE(reader.Next()) << i;
      // Matroska's times are milliseconds.
      EXPECT_NEAR(reader.seconds(), static_cast<double>(i) / 25, 1e-3);
      // Coding nearly without loss and chroma at half resolution: a step of 8 bits on average;
      // another frame differs by three.
      EXPECT_LT(MeanDifference(reader.Picture(), frames[i]), 1.2 / 255) << spec.encoder << i;
    }
    EXPECT_FALSE(reader.Next());
    EXPECT_EQ(reader.damaged(), 0);
  }
}

TEST_F(VideoReaderTest, F90_VariableFrameRatesKeepTheirTimes) {
  const std::vector<int64_t> times = {0, 20, 40, 100, 400, 410, 420, 1000, 1024};  // 1/600 s
  WriteClip(scratch_ / "a.mp4", FilmFrames(9), {.times = times});
  VideoReader reader(scratch_ / "a.mp4");
  for (size_t i = 0; i < times.size(); ++i) {
    ASSERT_TRUE(reader.Next());
    EXPECT_NEAR(reader.seconds(), static_cast<double>(times[i]) / 600, 1e-6);
  }
  EXPECT_FALSE(reader.Next());
}

// All eight display matrices: turned clockwise, then mirrored.
TEST_F(VideoReaderTest, F90_PhonesFilmsComeUpright) {
  constexpr int kOrientations[2][4] = {{1, 6, 3, 8}, {2, 5, 4, 7}};  // of EXIF
  for (const bool mirrored : {false, true})
    for (const int turn : {0, 90, 180, 270}) {
      WriteClip(scratch_ / "a.mp4", FilmFrames(3), {.turn = turn, .mirrored = mirrored});
      VideoReader reader(scratch_ / "a.mp4");
      ASSERT_TRUE(reader.Next());
      const Image picture = reader.Picture(), grey = reader.Grey(80);
      const bool turned = turn % 180 != 0;
      EXPECT_EQ(reader.info().orientation, kOrientations[mirrored][turn / 90]);
      EXPECT_EQ(reader.info().width, turned ? 96 : 160);
      EXPECT_EQ(picture.width, turned ? 96 : 160);
      EXPECT_EQ(picture.height, turned ? 160 : 96);
      EXPECT_EQ(grey.width, turned ? 48 : 80);
      // The square was in the top left corner; clockwise it goes right, down, left.
      const bool right = (turn == 90 || turn == 180) != mirrored;
      const bool bottom = turn == 180 || turn == 270;
      for (const Image* image : {&picture, &grey}) {
        const int x = right ? image->width - 5 : 4, y = bottom ? image->height - 5 : 4;
        EXPECT_GT(*image->at(x, y), 0.85f) << turn << mirrored;
        EXPECT_LT(*image->at(image->width - 1 - x, y), 0.8f) << turn << mirrored;
        EXPECT_LT(*image->at(x, image->height - 1 - y), 0.8f) << turn << mirrored;
      }
      // Red grows along a stored row, which the corners do not tell from a column.
      const auto red = [&](double across, double down) {
        return *picture.at(static_cast<int>(across * (picture.width - 1)),
                           static_cast<int>(down * (picture.height - 1)));
      };
      const double along =
          turned ? red(0.5, 0.7) - red(0.5, 0.3) : red(0.7, 0.5) - red(0.3, 0.5);
      EXPECT_GT(std::abs(along), 0.08) << turn << mirrored;
    }
}

// Even rows of the first moment, odd rows of a later one.
TEST_F(VideoReaderTest, OneMomentOfInterlacedFramesIsKept) {
  Image combed(160, 96, 3);
  for (int y = 0; y < combed.height; ++y)
    for (int x = 0; x < combed.width; ++x)
      std::fill_n(combed.at(x, y), 3,
                  y % 2 == 1 ? 0.2f : 0.3f + 0.4f * static_cast<float>(y) / 95);
  for (const bool interlaced : {true, false}) {
    if (!WriteClip(scratch_ / "a.mp4", {combed, combed, combed}, {.interlaced = interlaced}))
      GTEST_SKIP() << "no H.264 encoder";
    VideoReader reader(scratch_ / "a.mp4");
    ASSERT_TRUE(reader.Next());
    const Image picture = reader.Picture();
    double worst = 0;  // of all rows against the first moment's brightness there
    for (int y = 0; y < picture.height - 1; ++y)
      worst = std::max(worst, std::abs(*picture.at(80, y) - (0.3 + 0.4 * y / 95)));
    if (interlaced)
      EXPECT_LT(worst, 0.03);  // the codec's noise; the other moment is 0.1 to 0.5 darker
    else
      EXPECT_GT(worst, 0.4);
    while (reader.Next()) {
    }
    EXPECT_EQ(reader.interlaced(), interlaced ? 3 : 0);
  }
}

TEST_F(VideoReaderTest, PixelsThatAreNotSquareAreMadeSo) {
  WriteClip(scratch_ / "a.mp4", FilmFrames(2), {.aspect = {4, 3}});
  VideoReader reader(scratch_ / "a.mp4");
  EXPECT_EQ(reader.info().width, 213);
  ASSERT_TRUE(reader.Next());
  EXPECT_EQ(reader.Picture().width, 213);
  EXPECT_EQ(reader.Picture().height, 96);
}

// A colour of sRGB as BT.2020's values for the same light.
TEST_F(VideoReaderTest, WideGamutsBecomeSrgb) {
  const ClipSpec wide{.encoder = "libx265",
                      .primaries = AVCOL_PRI_BT2020,
                      .transfer = AVCOL_TRC_ARIB_STD_B67,
                      .matrix = AVCOL_SPC_BT2020_NCL,
                      .pixels = AV_PIX_FMT_YUV420P10};
  Image frame(128, 64, 3);
  for (int64_t i = 0; i < frame.num_pixels(); ++i) {
    // Linear sRGB (0.5, 0.2, 0.1) by the matrix of BT.2087: (0.3899, 0.2184, 0.1138), which is
    // times 203 cd/m^2, over HLG's peak of 1000 and the power 0.2 of the scene's luminance.
    frame.pixels[3 * i] = 0.6025f, frame.pixels[3 * i + 1] = 0.4664f;
    frame.pixels[3 * i + 2] = 0.3367f;
  }
  if (!WriteClip(scratch_ / "a.mp4", {frame, frame}, wide)) GTEST_SKIP() << "no HEVC encoder";
  VideoReader reader(scratch_ / "a.mp4");
  EXPECT_EQ(reader.info().colors, "BT.2020, HLG");
  ASSERT_TRUE(reader.Next());
  const Image picture = reader.Picture();
  // Encoded sRGB of the light, to a step of 10 bits and the codec's noise.
  EXPECT_NEAR(picture.at(64, 32)[0], 0.7354, 0.01);
  EXPECT_NEAR(picture.at(64, 32)[1], 0.4845, 0.01);
  EXPECT_NEAR(picture.at(64, 32)[2], 0.3492, 0.01);
}

TEST_F(VideoReaderTest, F90_DamagedEmptyAndOtherFilesAreRefusedByName) {
  WriteClip(scratch_ / "whole.mp4", FilmFrames(60));
  const std::string film = ReadText(scratch_ / "whole.mp4");
  EXPECT_TRUE(Contains(RefusalOf(Put("empty.mp4", "")), "empty file"));
  EXPECT_TRUE(Contains(RefusalOf(Put("text.mp4", "no film")), "cannot read this film"));
  EXPECT_TRUE(Contains(RefusalOf(scratch_ / "none.mp4"), "No such file"));
  EXPECT_TRUE(Contains(RefusalOf(scratch_.path()), "not a regular file"));
  // The index comes last: without its end there is nothing to find.
  EXPECT_TRUE(Contains(RefusalOf(Put("cut.mp4", film.substr(0, film.size() / 2))),
                       "cannot read this film"));
  // Bytes in the midst: what depends on them is passed over, nothing is invented.
  std::string hole = film;
  const size_t data = hole.find("mdat");
  for (size_t i = 0; i < 400; ++i) hole[data + hole.size() / 4 + i] = static_cast<char>(7 * i);
  EXPECT_EQ(RefusalOf(Put("hole.mp4", hole)), "");
  EXPECT_GT(damaged_, 0);
  EXPECT_LT(frames_, 60);
  EXPECT_GT(frames_, 10);
  // No byte of the pictures is left.
  for (size_t i = data + 4; i < hole.find("moov") - 4; ++i) hole[i] = static_cast<char>(i * 31);
  EXPECT_TRUE(Contains(RefusalOf(Put("noise.mp4", hole)), "no frame of this film"));
}

TEST_F(VideoReaderTest, F90_PlaylistsAndReferencesAreNotFollowed) {
  WriteClip(scratch_ / "other.ts", FilmFrames(3), {.container = "mpegts"});
  for (const std::string& list :
       {std::string("#EXTM3U\n#EXT-X-VERSION:3\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nother.ts\n"
                    "#EXT-X-ENDLIST\n"),
        std::string("ffconcat version 1.0\nfile 'other.ts'\n"),
        std::string("v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\nm=video 5004 RTP/AVP 96\r\n")})
    EXPECT_TRUE(Contains(RefusalOf(Put("list.mp4", list)), "cannot read this film")) << list;
}

TEST_F(VideoReaderTest, F90_LongAndLargeFilmsEnd) {
  WriteClip(scratch_ / "a.mp4", FilmFrames(50));
  EXPECT_TRUE(
      Contains(RefusalOf(scratch_ / "a.mp4", {.max_seconds = 1}), "a film of more than"));
  EXPECT_TRUE(Contains(RefusalOf(scratch_ / "a.mp4", {.max_frames = 40}), "40 frames"));
  EXPECT_TRUE(Contains(RefusalOf(scratch_ / "a.mp4", {.max_decoded_pixels = 40 * 160 * 96}),
                       "a film of more than"));
  EXPECT_TRUE(Contains(RefusalOf(scratch_ / "a.mp4", {.max_pixels = 10000}), "megapixels"));
  EXPECT_EQ(RefusalOf(scratch_ / "a.mp4", {.max_frames = 50}), "");
  // A stream without an index, whose header says nothing of its length.
  WriteClip(scratch_ / "b.ts", FilmFrames(50), {.container = "mpegts"});
  std::string endless;
  for (int i = 0; i < 40; ++i) endless += ReadText(scratch_ / "b.ts");
  EXPECT_TRUE(Contains(RefusalOf(Put("c.ts", endless), {.max_frames = 300}), "300 frames"));
}

// Of a film of many frames, those that no other depends on are passed over, the same each time.
TEST_F(VideoReaderTest, LongFilmsAreThinnedAlike) {
  WriteClip(scratch_ / "a.mp4", FilmFrames(1900, 64, 48));
  const auto times = [&](bool every) {
    VideoReader reader(scratch_ / "a.mp4", {.every_frame = every});
    std::vector<double> seconds;
    while (reader.Next()) seconds.push_back(reader.seconds());
    return seconds;
  };
  EXPECT_EQ(times(true).size(), 1900u);
  EXPECT_LT(times(false).size(), 1700u);
  EXPECT_GT(times(false).size(), 400u);
  EXPECT_EQ(times(false), times(false));
}

}  // namespace
}  // namespace regrade
