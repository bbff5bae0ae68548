#include <gtest/gtest.h>

#include "kernels/base/error.h"
#include "pipeline/images/mp4_faststart.h"
#include "pipeline/images/video_writer.h"
#include "tests/pipeline/picture_corpus.h"

namespace regrade {
namespace {

using testing::Photo;
using testing::ReadBytes;
using testing::ScratchFolder;
using testing::WriteBytes;

std::string Big(uint64_t value, int bytes) {
  std::string text;
  for (int i = bytes - 1; i >= 0; --i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}

std::string Atom(const std::string& type, const std::string& body) {
  return Big(body.size() + 8, 4) + type + body;
}

// ftyp, mdat with "DATA" in it, moov with one table of chunk offsets that points at it.
std::string SmallMovie(int width = 4, uint64_t count = 1) {
  const std::string ftyp = Atom("ftyp", "isom0000"), mdat = Atom("mdat", "xxDATAyy");
  const uint64_t offset = ftyp.size() + 8 + 2;
  const std::string table =
      Atom(width == 4 ? "stco" : "co64", Big(0, 4) + Big(count, 4) + Big(offset, width));
  return ftyp + mdat +
         Atom("moov", Atom("trak", Atom("mdia", Atom("minf", Atom("stbl", table)))));
}

std::vector<std::string> Types(const std::string& file) {
  std::vector<std::string> types;
  for (const Mp4Atom& atom : ListMp4Atoms(file)) types.push_back(atom.type);
  return types;
}

TEST(Faststart, OffsetsFollowTheirData) {
  for (const int width : {4, 8}) {
    const std::string moved = MoveIndexFirst(SmallMovie(width));
    EXPECT_EQ(Types(moved), (std::vector<std::string>{"ftyp", "moov", "mdat"}));
    const size_t table = moved.find(width == 4 ? "stco" : "co64");
    uint64_t offset = 0;
    for (int i = 0; i < width; ++i)
      offset = offset << 8 | static_cast<unsigned char>(moved[table + 12 + i]);
    EXPECT_EQ(moved.substr(offset, 4), "DATA");
    EXPECT_EQ(MoveIndexFirst(moved), moved);  // nothing left to do
  }
}

TEST(Faststart, LastAtomWithoutASizeGetsOne) {
  // mdat last and open-ended, moov behind a free atom: after the move sizes must all be real.
  std::string movie = SmallMovie();
  const size_t moov = movie.find("moov") - 4;
  for (int i = 0; i < 4; ++i) movie[moov + i] = 0;  // "to the end of the file"
  EXPECT_EQ(Types(MoveIndexFirst(movie)), (std::vector<std::string>{"ftyp", "moov", "mdat"}));
}

TEST(Faststart, LyingSizesAndCountsAreRefused) {
  try {
    MoveIndexFirst(SmallMovie(4, 0x40000000));
    FAIL();
  } catch (const Error& error) {
    // Refused for its count, before an entry behind the atom is read.
    EXPECT_TRUE(testing::Contains(error.what_failed(), "longer than its atom"));
  }
  EXPECT_THROW(MoveIndexFirst(""), Error);
  const std::string movie = SmallMovie();
  EXPECT_THROW(MoveIndexFirst(movie.substr(0, movie.find("moov") - 4)), Error);  // no index
  std::string outside = movie;
  outside[outside.find("stco") + 12] = 0x7f;  // chunk offset far behind the end
  EXPECT_THROW(MoveIndexFirst(outside), Error);
}

TEST(Faststart, AnyCutAndAnyFlippedByteEndsWell) {
  const std::string movie = SmallMovie();
  for (size_t cut = 0; cut < movie.size(); ++cut)
    EXPECT_THROW(MoveIndexFirst(movie.substr(0, cut)), Error) << cut;
  for (size_t i = 0; i < movie.size(); ++i)
    for (const int flip : {1, 0x80, 0xff}) {
      std::string mutant = movie;
      mutant[i] = static_cast<char>(mutant[i] ^ flip);
      try {
        EXPECT_EQ(MoveIndexFirst(mutant).size(), mutant.size());
      } catch (const Error&) {
      }
    }
}

TEST(VideoFile, MovieHasItsIndexFirstAndAllFrames) {
  const ScratchFolder scratch;
  const std::string path = scratch / "a b'c.mp4";
  VideoWriter writer(path, 96, 64, 24);
  for (int i = 0; i < 7; ++i) writer.Add(Photo(96, 64, i));
  EXPECT_FALSE(std::filesystem::exists(path));
  writer.Finish();
  const std::vector<std::string> types = Types(ReadBytes(path));
  ASSERT_GE(types.size(), 3u);
  EXPECT_EQ(types[1], "moov");
  EXPECT_EQ(CountVideoFrames(path), 7);
  // Nothing else was left beside it.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch.path()), {}), 1);
}

TEST(VideoFile, OddSizesAndOtherChannelsAreTaken) {
  const ScratchFolder scratch;
  for (const int channels : {1, 3, 4}) {
    const std::string path = scratch / std::to_string(channels) + ".mp4";
    VideoWriter writer(path, 65, 33, 30);
    for (int i = 0; i < 3; ++i) writer.Add(Photo(65, 33, i, channels));
    writer.Finish();
    EXPECT_EQ(CountVideoFrames(path), 3);
  }
}

TEST(VideoFile, AnUnfinishedMovieLeavesNothing) {
  const ScratchFolder scratch;
  { VideoWriter(scratch / "a.mp4", 64, 64, 24).Add(Photo(64, 64, 1)); }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(VideoFile, AMissingFolderIsReported) {
  const ScratchFolder scratch;
  try {
    VideoWriter writer(scratch / "none/a.mp4", 64, 64, 24);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kResources);
  }
}

TEST(VideoFile, WhatIsNoVideoCountsAsNone) {
  const ScratchFolder scratch;
  WriteBytes(scratch / "a.mp4", "text");
  EXPECT_EQ(CountVideoFrames(scratch / "a.mp4"), -1);
}

}  // namespace
}  // namespace regrade
