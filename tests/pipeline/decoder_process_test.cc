// Pictures and films that are decoded in a child process: the same results and refusals, and
// files that crash, starve or stall the child are refused by name.
#include "pipeline/images/decoder_process.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "pipeline/capture/ingest_photos.h"
#include "pipeline/images/decoder_message.h"
#include "pipeline/images/video_reader.h"
#include "pipeline/images/video_writer.h"
#include "tests/pipeline/color_files.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::Little;
using testing::Photo;

const std::vector<std::string> kChild = {REGRADE_PROGRAM, kDecoderFlag};

// A script in place of the child.
std::vector<std::string> Script(const std::string& text) { return {"/bin/sh", "-c", text}; }

struct Failure {
  std::string what, where, hint;
  bool operator==(const Failure&) const = default;
};

class DecoderProcessTest : public testing::PictureTest {
 protected:
  ~DecoderProcessTest() override { DecodeApart({}); }

  Failure FailureOf(const std::string& path) {
    const Error error = testing::ErrorFrom([&] { DecodePhoto(path); });
    EXPECT_TRUE(error.code() == ExitCode::kInput || error.code() == ExitCode::kDone);
    return {error.what_failed(), error.where(), error.hint()};
  }

  // A TIFF whose colour profile has a text far beyond its end, over which OpenImageIO 2.4
  // crashes.
  std::string CrashingTiff() {
    std::string profile = testing::IccProfile(testing::kP3Primaries, 0, "P3");
    profile.replace(profile.find("mluc") + 24, 4, "\x92\x0f\x81\xd8");
    const Image image = Photo(64, 64, 1);
    constexpr uint32_t kEntries = 11, kData = 8 + 2 + kEntries * 12 + 4;
    const std::string data(reinterpret_cast<const char*>(image.pixels.data()),
                           image.pixels.size() * sizeof(float));
    const auto entry_of = [](int tag, int type, size_t value, size_t count = 1) {
      return testing::TiffEntry(tag, type, static_cast<uint32_t>(count),
                                static_cast<uint32_t>(value));
    };
    return std::string("II*\0", 4) + Little(8, 4) + Little(kEntries, 2) + entry_of(256, 4, 64) +
           entry_of(257, 4, 64) + entry_of(258, 3, 32) + entry_of(259, 3, 1) +
           entry_of(262, 3, 2) + entry_of(273, 4, kData) + entry_of(277, 3, 3) +
           entry_of(278, 4, 64) + entry_of(279, 4, data.size()) + entry_of(339, 3, 3) +
           entry_of(34675, 7, kData + data.size(), profile.size()) + Little(0, 4) + data +
           profile;
  }
};

TEST_F(DecoderProcessTest, PicturesAndRefusalsAreTheSame) {
  const std::string jpeg = EncodeJpeg(Photo(96, 64, 1), 90);
  std::vector<std::string> paths = {
      Put("turned.jpg", testing::WithSegment(jpeg, 0xe1, testing::ExifBlock(6, 28))),
      Put("fine.png", EncodePng16(Photo(70, 65, 2, 4))),
      Put("grey.png", EncodePng8(Photo(70, 65, 3, 1))),
      Put("float.tif", testing::FloatTiff(Photo(64, 80, 4))),
      Put("half.jpg", jpeg.substr(0, jpeg.size() / 2)),
      Put("text.jpg", "no picture"),
      scratch_ / "none.png",
      scratch_.path(),
  };
  std::vector<Failure> failures;
  std::vector<DecodedPhoto> photos;
  for (const std::string& path : paths) {
    failures.push_back(FailureOf(path));
    photos.push_back(failures.back().what.empty() ? DecodePhoto(path) : DecodedPhoto());
  }
  EXPECT_EQ(std::ranges::count(failures, Failure()), 4);
  DecodeApart({.command = kChild});
  for (size_t i = 0; i < paths.size(); ++i) {
    ASSERT_EQ(FailureOf(paths[i]), failures[i]) << paths[i];
    if (!failures[i].what.empty()) continue;
    const DecodedPhoto &apart = DecodePhoto(paths[i]), &here = photos[i];
    EXPECT_EQ(apart.image.pixels, here.image.pixels) << paths[i];
    EXPECT_TRUE(apart.image.SameSize(here.image));
    EXPECT_EQ(apart.image.channels, here.image.channels);
    EXPECT_EQ(apart.exif_focal_px, here.exif_focal_px);
    EXPECT_EQ(apart.bits, here.bits);
    EXPECT_EQ(apart.notice, here.notice);
    EXPECT_EQ(apart.colors, here.colors);
    EXPECT_EQ(apart.clipped, here.clipped);
  }
}

TEST_F(DecoderProcessTest, FilmsAreTheSame) {
  const std::string path = scratch_ / "a.mp4";
  VideoWriter film(path, 64, 48, 25);
  for (int i = 0; i < 5; ++i) film.Add(Photo(64, 48, static_cast<uint64_t>(i)));
  film.Finish();
  VideoReader here(path);
  DecodeApart({.command = kChild});
  VideoReader apart(path);
  EXPECT_EQ(apart.info().width, here.info().width);
  EXPECT_EQ(apart.info().seconds, here.info().seconds);
  EXPECT_EQ(apart.info().frames, here.info().frames);
  while (here.Next()) {
    ASSERT_TRUE(apart.Next());
    EXPECT_EQ(apart.seconds(), here.seconds());
    EXPECT_EQ(apart.Grey(32).pixels, here.Grey(32).pixels);
    EXPECT_EQ(apart.Picture().pixels, here.Picture().pixels);
  }
  EXPECT_FALSE(apart.Next());
  // Other files are read meanwhile.
  VideoReader again(path);
  EXPECT_TRUE(again.Next());
  EXPECT_EQ(DecodePhoto(Put("a.png", EncodePng8(Photo(64, 64, 9)))).image.width, 64);
  EXPECT_TRUE(again.Next());
  const std::string cut = testing::ReadText(path).substr(0, 300);
  EXPECT_THROW(VideoReader reader(Put("cut.mp4", cut)), Error);
}

TEST_F(DecoderProcessTest, ACrashNamesTheFile) {
  const std::string path = Put("a.png", EncodePng8(Photo(64, 64, 1)));
  DecodeApart({.command = Script("kill -SEGV $$")});
  EXPECT_EQ(FailureOf(path).where, path);
  EXPECT_TRUE(Contains(FailureOf(path).what, "crashed its decoder (Segmentation fault)"));
  EXPECT_THROW(VideoReader reader(path), Error);
  DecodeApart({.command = Script("kill -ABRT $$")});
  EXPECT_TRUE(Contains(FailureOf(path).what, "(Aborted)"));
  DecodeApart({.command = {"/nowhere/decoder"}});
  EXPECT_REGRADE_ERROR(DecodePhoto(path), ExitCode::kExternalProgram, "");
}

TEST_F(DecoderProcessTest, TimeAndMemoryAreBounded) {
  const std::string path = Put("a.png", EncodePng8(Photo(400, 300, 1)));
  DecodeApart({.command = Script("exec sleep 1000"), .seconds = 0.01});
  EXPECT_TRUE(Contains(FailureOf(path).what, "was not decoded within"));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  // 1.4 MB of pixels as floats.
  DecodeApart({.command = kChild, .memory_bytes = 1 << 20});
  EXPECT_TRUE(Contains(FailureOf(path).what, "needs more than 1 MiB"));
#endif
  DecodeApart({.command = kChild});
  EXPECT_EQ(DecodePhoto(path).image.width, 400);
}

// A child that has decoded others may die of what they left: the file gets a new one.
TEST_F(DecoderProcessTest, AFileIsNotBlamedForOthers) {
  const std::string good = Put("a.png", EncodePng8(Photo(64, 64, 1)));
  const std::string bad = Put("b.tif", CrashingTiff()), log = scratch_ / "log";
  DecodeApart({.command = Script("echo >> " + log + "; exec " + kChild[0] + " " + kChild[1])});
  const auto starts = [&] { return testing::ReadText(log).size(); };
  DecodePhoto(good);
  DecodePhoto(good);
  EXPECT_EQ(starts(), 1u);
  const Failure failure = FailureOf(bad);
  if (!Contains(failure.what, "crashed its decoder"))
    GTEST_SKIP() << "this OpenImageIO bears it";
  EXPECT_EQ(failure.where, bad);
  EXPECT_EQ(starts(), 2u);  // tried twice
  FailureOf(bad);
  EXPECT_EQ(starts(), 3u);  // once: by a new child
  EXPECT_EQ(DecodePhoto(good).image.width, 64);
}

TEST_F(DecoderProcessTest, OneBadFileOfManyIsLeftOutByName) {
  for (int i = 0; i < 4; ++i)
    Put("in/p" + std::to_string(i) + ".jpg",
        EncodeJpeg(Photo(96, 64, static_cast<uint64_t>(i)), 90));
  Put("in/p2b.tif", CrashingTiff());
  DecodeApart({.command = kChild});
  const IngestResult result = IngestPhotos(scratch_ / "in", scratch_ / "out", {}, {});
  EXPECT_EQ(result.photos.size() + (result.statuses[3].status != PhotoState::kUsed), 5u);
  EXPECT_EQ(result.statuses[3].file, "p2b.tif");
}

}  // namespace
}  // namespace regrade
