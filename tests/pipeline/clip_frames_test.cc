// Frames that are picked of films: how many, which, and how they are staged.
#include "pipeline/capture/clip_frames.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/random.h"
#include "kernels/image/resize.h"
#include "pipeline/capture/ingest_photos.h"
#include "reconstruct/colmap/listed_pairs.h"
#include "tests/pipeline/clip_file.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::ClipSpec;
using testing::Contains;
using testing::Photo;
using testing::TemporaryFolder;
using testing::WriteClip;

ClipSurvey Survey(const std::vector<FrameMeasure>& frames, const std::string& file = "a.mp4") {
  ClipSurvey clip;
  clip.file = file;
  clip.frames = frames;
  return clip;
}

// `count` frames that travel so many steps evenly.
std::vector<FrameMeasure> Walk(int count, double steps) {
  std::vector<FrameMeasure> frames;
  for (int i = 0; i < count; ++i) frames.push_back({i / 30.0, 1, steps * i / (count - 1)});
  return frames;
}

// The noise is exact in floats at both brightnesses, so that only the sums round: of squares
// near 2^48 no digit of a variance of 1 is left.
TEST(SharpnessOf, BrightnessDoesNotChangeIt) {
  Image noise(64, 48, 1);
  for (size_t i = 0; i < noise.pixels.size(); ++i)
    noise.pixels[i] = 2 * static_cast<float>(RandomIndex(1, 0, i, 2));
  Image bright = noise;
  for (float& v : bright.pixels) v += 0x1p24f;
  const double sharp = SharpnessOf(noise);
  EXPECT_NEAR(sharp, 4, 0.3);  // two differences of variance 2 over a variance of 1
  EXPECT_NEAR(SharpnessOf(bright), sharp, 1e-9);
}

TEST(PickFrames, F90_TheirNumberFollowsTheTravel) {
  const auto picked = [](double steps, int wanted = 0) {
    return PickFrames({Survey(Walk(900, steps))}, wanted)[0].size();
  };
  EXPECT_EQ(picked(5), 40u);
  EXPECT_EQ(picked(70), 70u);
  EXPECT_EQ(picked(1000), 120u);
  EXPECT_EQ(picked(70, 25), 25u);
  EXPECT_EQ(PickFrames({Survey(Walk(17, 70))}, 0)[0].size(), 17u) << "there are no more";
  EXPECT_TRUE(PickFrames({Survey({})}, 0)[0].empty());
}

TEST(PickFrames, F90_TheSharpestOfEachPartIsTaken) {
  std::vector<FrameMeasure> frames = Walk(600, 60);
  for (size_t i = 0; i < frames.size(); ++i) frames[i].sharpness = i % 10 == 7 ? 2 : 1;
  const std::vector<size_t> picked = PickFrames({Survey(frames)}, 0)[0];
  // Parts are not aligned with the sharp frames: an odd one holds none.
  const auto sharp = std::ranges::count_if(picked, [](size_t i) { return i % 10 == 7; });
  EXPECT_GE(sharp, static_cast<int64_t>(picked.size()) - 2);
  EXPECT_TRUE(std::ranges::is_sorted(picked));
}

TEST(PickFrames, F90_ACameraThatStandsStillGetsFewFrames) {
  std::vector<FrameMeasure> frames = Walk(300, 60);
  for (int i = 0; i < 600; ++i) frames.push_back({10 + i / 30.0, 1, 60});
  for (int i = 0; i < 300; ++i) frames.push_back({30 + i / 30.0, 1, 60 + i / 5.0});
  const std::vector<size_t> picked = PickFrames({Survey(frames)}, 0)[0];
  const auto still =
      std::ranges::count_if(picked, [](size_t i) { return i >= 300 && i < 900; });
  EXPECT_LE(still, 2);
  EXPECT_GE(picked.size(), 115u);
}

TEST(PickFrames, SeveralFilmsShareByTheirTravel) {
  const auto picked =
      PickFrames({Survey(Walk(300, 60)), Survey(Walk(300, 30)), Survey(Walk(300, 1))}, 0);
  EXPECT_NEAR(static_cast<double>(picked[0].size()), 60, 1);
  EXPECT_NEAR(static_cast<double>(picked[1].size()), 30, 1);
  EXPECT_EQ(picked[2].size(), 8u) << "a few in any case";
}

TEST(PickFrames, AMotionlessFilmIsDividedByTime) {
  const std::vector<size_t> picked = PickFrames({Survey(Walk(200, 0))}, 0)[0];
  EXPECT_EQ(picked.size(), 40u);
  for (size_t i = 1; i < picked.size(); ++i) EXPECT_LE(picked[i] - picked[i - 1], 10u);
}

// A window that slides over a large picture, in pixels for each frame.
class ClipFrames : public ::testing::Test {
 protected:
  // Blobs of several sizes that do not repeat.
  ClipFrames() : scene_(1600, 400, 3) {
    for (const int cell : {8, 16, 40}) {
      Image noise(1600 / cell, 400 / cell, 3);
      for (size_t i = 0; i < noise.pixels.size(); ++i)
        noise.pixels[i] = static_cast<float>(RandomDouble(5, static_cast<uint64_t>(cell), i));
      const Image blobs = Resize(noise, 1600, 400);
      for (size_t i = 0; i < blobs.pixels.size(); ++i) scene_.pixels[i] += blobs.pixels[i] / 3;
    }
  }
  Image Window(double left, double top = 40, bool blurred = false) const {
    Image frame(480, 320, 3);
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x)
        for (int c = 0; c < 3; ++c) {
          double sum = 0;
          const int reach = blurred ? 10 : 0;
          for (int k = -reach; k <= reach; ++k)
            sum += scene_.at(std::clamp(static_cast<int>(left) + x + k, 0, 1599),
                             static_cast<int>(top) + y)[c];
          frame.at(x, y)[c] = static_cast<float>(sum / (2 * reach + 1));
        }
    return frame;
  }
  ClipSurvey SurveyOf(const std::vector<Image>& frames, const ClipSpec& spec = {}) {
    WriteClip(scratch_ / "a.mp4", frames, spec);
    return SurveyClip("a.mp4", scratch_ / "a.mp4", {}, {});
  }

  Image scene_;
  TemporaryFolder scratch_;
};

TEST_F(ClipFrames, TravelIsMeasuredInSteps) {
  std::vector<Image> frames;
  for (int i = 0; i < 50; ++i) frames.push_back(Window(20.0 * i));
  // 980 pixels, and a step is 0.06 * 480 of them. Where the picture comes in at the edge the
  // flow is guessed: that counts as some parallax.
  EXPECT_NEAR(SurveyOf(frames).Travel(), 980 / (0.06 * 480), 7);
}

TEST_F(ClipFrames, F90_ShakingIsNoTravel) {
  std::vector<Image> frames;
  for (int i = 0; i < 60; ++i)
    frames.push_back(Window(300 + 8 * std::sin(2.1 * i), 40 + 8 * std::cos(1.7 * i)));
  EXPECT_LT(SurveyOf(frames).Travel(), 1.5);
}

TEST_F(ClipFrames, F90_BlurredFramesAreNotPicked) {
  std::vector<Image> frames;
  for (int i = 0; i < 80; ++i) frames.push_back(Window(8.0 * i, 40, i % 4 != 1));
  const std::vector<size_t> picked = PickFrames({SurveyOf(frames)}, 15)[0];
  EXPECT_GE(picked.size(), 12u);
  for (const size_t i : picked) EXPECT_EQ(i % 4, 1u) << i;
}

TEST_F(ClipFrames, F90_FramesAreStagedLikePhotos) {
  std::vector<Image> frames;
  for (int i = 0; i < 60; ++i) frames.push_back(Window(15.0 * i));
  std::filesystem::create_directory(scratch_ / "in");
  ASSERT_TRUE(WriteClip(scratch_ / "in/walk.mp4", frames, {.turn = 90}));
  for (const char* source : {"in", "in/walk.mp4"}) {
    const IngestResult result = IngestPhotos(scratch_ / source, scratch_ / "out", {}, {});
    ASSERT_GE(result.photos.size(), 30u);
    ASSERT_LE(result.photos.size(), 60u);
    for (size_t i = 0; i < result.photos.size(); ++i) {
      const StagedPhoto& photo = result.photos[i];
      double seconds = 0;
      ASSERT_EQ(std::sscanf(photo.file.c_str(), "walk.mp4/%lfs.png", &seconds), 1)
          << photo.file;
      EXPECT_EQ(photo.clip, 0);
      EXPECT_EQ(photo.bits, 8);
      EXPECT_EQ(photo.width, 320);
      EXPECT_EQ(photo.height, 480);
      // The staged picture is the frame of that time, turned clockwise.
      const Image staged = ReadImage(photo.path);
      const Image& frame = frames[static_cast<size_t>(std::lround(seconds * 25))];
      EXPECT_NEAR(*staged.at(100, 200), *frame.at(200, 319 - 100), 0.05);
    }
    EXPECT_TRUE(Contains(result.summary, "frames of walk.mp4")) << result.summary;
    EXPECT_TRUE(Contains(result.notices[0], "of 60 frames (2.4 s)")) << result.notices[0];
    EXPECT_EQ(IngestPhotos(scratch_ / source, scratch_ / "out", {}, {}).fingerprint,
              result.fingerprint);
  }
  IngestOptions few{.video_frames = 12};
  EXPECT_EQ(IngestPhotos(scratch_ / "in", scratch_ / "out", few, {}).photos.size(), 12u);
  few.take_clips = false;
  EXPECT_THROW(IngestPhotos(scratch_ / "in", scratch_ / "out", few, {}), Error);
}

TEST_F(ClipFrames, F90_ADamagedFilmIsNamedAndTheRestIsTaken) {
  for (int i = 0; i < 3; ++i)
    testing::WriteText(scratch_ / "in/p" + std::to_string(i) + ".jpg",
                       EncodeJpeg(Photo(96, 64, static_cast<uint64_t>(i)), 90));
  WriteClip(scratch_ / "whole.mp4", {Window(0), Window(50), Window(100)});
  const std::string film = testing::ReadText(scratch_ / "whole.mp4");
  testing::WriteText(scratch_ / "in/cut.mp4", film.substr(0, film.size() / 2));
  const IngestResult result = IngestPhotos(scratch_ / "in", scratch_ / "out", {}, {});
  EXPECT_EQ(result.photos.size(), 3u);
  EXPECT_EQ(result.statuses[0].file, "cut.mp4");
  EXPECT_TRUE(Contains(result.statuses[0].why, "cannot read this film"))
      << result.statuses[0].why;
  EXPECT_REGRADE_ERROR(IngestPhotos(scratch_ / "in/cut.mp4", scratch_ / "out", {}, {}),
                       ExitCode::kInput, (scratch_ / "in/cut.mp4") + ": ",
                       "cannot read this film");
}

std::vector<StagedPhoto> Staged(int photos, int frames) {
  std::vector<StagedPhoto> staged(static_cast<size_t>(photos + frames));
  for (int i = photos; i < photos + frames; ++i) staged[static_cast<size_t>(i)].clip = 0;
  return staged;
}

TEST(ListedPairs, FramesAreMatchedWithTheirNeighboursAndPhotosWithTheFilm) {
  EXPECT_FALSE(HasClips(Staged(5, 0)));
  EXPECT_TRUE(HasClips(Staged(5, 1)));
  const PhotoPairs pairs = PairsOfClips(Staged(20, 80));
  const auto has = [&](size_t i, size_t j) {
    return std::ranges::binary_search(pairs, std::pair(i, j));
  };
  for (size_t i = 20; i + 1 < 100; ++i) EXPECT_TRUE(has(i, i + 1)) << i;
  EXPECT_TRUE(has(20, 92)) << "ends of a loop";
  for (size_t i = 0; i < 20; ++i)
    EXPECT_EQ(
        std::ranges::count_if(pairs, [&](auto p) { return p.first == i && p.second >= 20; }),
        10);
  // A twelfth of all pairs of 200: COLMAP's time is in proportion.
  EXPECT_LT(PairsOfClips(Staged(80, 120)).size(), 200u * 199 / 2 / 6);
  EXPECT_TRUE(std::ranges::is_sorted(pairs));
}

}  // namespace
}  // namespace regrade
