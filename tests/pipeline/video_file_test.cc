#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/joined_film.h"
#include "pipeline/images/video_reader.h"
#include "pipeline/images/video_writer.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using testing::Photo;
using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

// Types of the file's top-level boxes, in order.
std::vector<std::string> Boxes(const std::string& file) {
  std::vector<std::string> types;
  for (size_t at = 0; at + 8 <= file.size();) {
    size_t size = 0;
    for (size_t i = at; i < at + 4; ++i) size = size << 8 | static_cast<unsigned char>(file[i]);
    types.push_back(file.substr(at + 4, 4));
    at += std::max<size_t>(size, 8);
  }
  return types;
}

void WriteFilm(const std::string& path, int width, int height, int frames, int channels = 3) {
  VideoWriter writer(path, width, height, 24);
  for (int i = 0; i < frames; ++i) writer.Add(Photo(width, height, i, channels));
  writer.Finish();
}

TEST(VideoFile, MovieHasItsIndexFirstAndAllFrames) {
  const TemporaryFolder scratch;
  const std::string path = scratch / "a b'c.mp4";
  VideoWriter writer(path, 96, 64, 24);
  for (int i = 0; i < 7; ++i) writer.Add(Photo(96, 64, i));
  EXPECT_FALSE(std::filesystem::exists(path));
  writer.Finish();
  const std::vector<std::string> types = Boxes(ReadText(path));
  ASSERT_GE(types.size(), 3u);
  EXPECT_EQ(types[0], "ftyp");
  EXPECT_EQ(types[1], "moov");
  EXPECT_EQ(CountVideoFrames(path), 7);
  // Nothing else was left beside it.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch.path()), {}), 1);
}

// Whole groups, and last ones of any length; a frame changes its own group alone.
TEST(VideoFile, GroupsAreEncodedByThemselves) {
  const TemporaryFolder scratch;
  const auto film = [&](int first, int last, int changed) {
    const std::string path = scratch / "film.mp4";
    VideoWriter writer(path, 64, 48, 30);
    for (int i = first; i < last; ++i) writer.Add(Photo(64, 48, i == changed ? 1000 : i));
    writer.Finish();
    EXPECT_EQ(CountVideoFrames(path), last - first);
    return ReadText(path);
  };
  for (const int tail : {0, 1, 2, 3, 5}) film(0, kFilmGroup + tail, -1);
  const int frames = 2 * kFilmGroup + 7;
  const std::string one = film(0, frames, -1), other = film(0, frames, 10),
                    rest = film(kFilmGroup, frames, -1);
  const auto same = std::mismatch(one.rbegin(), one.rend(), other.rbegin(), other.rend());
  const size_t pictures = rest.size() - rest.rfind("mdat") - 4;
  EXPECT_GE(static_cast<size_t>(same.first - one.rbegin()), pictures);
  EXPECT_EQ(one.substr(one.size() - pictures), rest.substr(rest.size() - pictures));
  EXPECT_NE(one, other);
}

TEST(VideoFile, PartsJoinToTheFilmOfOneWriter) {
  const TemporaryFolder scratch;
  for (const double rate : {24., 30., 23.976})
    for (const int width : {64, 161}) {
      const auto film = [&](const char* name, int first, int last) {
        const std::string path = scratch / name;
        VideoWriter writer(path, width, 96, rate);
        for (int i = first; i < last; ++i) writer.Add(Photo(width, 96, i));
        writer.Finish();
        return FilmPart{path, last - first};
      };
      const int frames = 3 * kFilmGroup + 5;
      const std::string whole = film("whole.mp4", 0, frames).path;
      JoinFilms({film("a.mp4", 0, kFilmGroup), film("b.mp4", kFilmGroup, 3 * kFilmGroup),
                 film("c.mp4", 3 * kFilmGroup, frames)},
                scratch / "joined.mp4");
      EXPECT_EQ(ReadText(scratch / "joined.mp4"), ReadText(whole)) << width << " " << rate;
    }
  const FilmPart first = {scratch / "a.mp4", kFilmGroup};
  const auto refused = [&](const char* name, int frames) {
    EXPECT_REGRADE_ERROR(JoinFilms({first, {scratch / name, frames}}, scratch / "j.mp4"),
                         ExitCode::kInput, name);
  };
  WriteFilm(scratch / "small.mp4", 32, 32, 3);
  refused("small.mp4", 3);
  refused("absent.mp4", 3);
  refused("a.mp4", kFilmGroup + 1);
  refused("a.mp4", kFilmGroup - 1);
  const std::string film = ReadText(first.path);
  WriteText(scratch / "no_index.mp4", film.substr(0, 100));
  refused("no_index.mp4", kFilmGroup);
  // Its index comes first.
  WriteText(scratch / "cut.mp4", film.substr(0, film.size() / 2));
  refused("cut.mp4", kFilmGroup);
  WriteText(scratch / "playlist.mp4", "ffconcat version 1.0\nfile a.mp4\n");
  refused("playlist.mp4", kFilmGroup);
  EXPECT_FALSE(std::filesystem::exists(scratch / "j.mp4"));
}

TEST(VideoFile, OddSizesAndOtherChannelsAreTaken) {
  const TemporaryFolder scratch;
  for (const int channels : {1, 3, 4}) {
    const std::string path = scratch / std::to_string(channels) + ".mp4";
    WriteFilm(path, 65, 33, 3, channels);
    EXPECT_EQ(CountVideoFrames(path), 3);
  }
}

TEST(VideoFile, EqualFramesGiveEqualBytesWithoutPathsOrDates) {
  const TemporaryFolder scratch;
  WriteFilm(scratch / "a.mp4", 64, 48, 5);
  WriteFilm(scratch / "another.mp4", 64, 48, 5);
  const std::string film = ReadText(scratch / "a.mp4");
  EXPECT_EQ(film, ReadText(scratch / "another.mp4"));
  EXPECT_EQ(film.find(std::filesystem::path(scratch.path()).filename().string()),
            std::string::npos);
  EXPECT_EQ(film.find("regrade"), std::string::npos);
  const size_t header = film.find("mvhd");  // version, flags, creation time, modification time
  ASSERT_NE(header, std::string::npos);
  EXPECT_EQ(film.substr(header + 8, 8), std::string(8, '\0'));
}

// A slope that moves by two pixels a frame, with noise of its own in each.
Image MovingSlope(int width, int height, int frame) {
  Image image(width, height, 3);
  uint32_t random = 1 + static_cast<uint32_t>(frame);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        random = random * 1664525u + 1013904223u;
        image.at(x, y)[c] =
            0.5f + 0.4f * (x + 2 * frame) / width - 0.3f * y / height + (random >> 24) / 5100.f;
      }
  return image;
}

// Memory that nobody wrote has other bytes in each run.
TEST(VideoFile, FilmsDoNotDependOnUnwrittenMemory) {
  const TemporaryFolder scratch;
  std::vector<std::string> films;
  for (const int fill : {1, 16, 64, 254}) {
    mallopt(M_PERTURB, fill);  // malloc's memory is filled with it
    const std::string path = scratch / std::to_string(fill) + ".mp4";
    {
      VideoWriter writer(path, 64, 48, 24);
      for (int i = 0; i < 4; ++i) writer.Add(MovingSlope(64, 48, i));
      writer.Finish();
    }
    mallopt(M_PERTURB, 0);
    films.push_back(ReadText(path));
  }
  for (const std::string& film : films) EXPECT_TRUE(film == films[0]);
}

TEST(VideoFile, AFullDiskIsReportedAndTheOldFilmStays) {
  const TemporaryFolder scratch;
  WriteText(scratch / "a.mp4", "old");
  rlimit before;
  ::getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = ::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{4096, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_REGRADE_ERROR(WriteFilm(scratch / "a.mp4", 320, 240, 10), ExitCode::kResources,
                       (scratch / "a.mp4") + ": ", "File too large", "(");
  ::setrlimit(RLIMIT_FSIZE, &before);
  ::signal(SIGXFSZ, handler);
  EXPECT_EQ(ReadText(scratch / "a.mp4"), "old");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch.path()), {}), 1);
}

TEST(VideoFile, AnUnfinishedMovieLeavesNothing) {
  const TemporaryFolder scratch;
  { VideoWriter(scratch / "a.mp4", 64, 64, 24).Add(Photo(64, 64, 1)); }
  EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(VideoFile, AMissingFolderIsReported) {
  const TemporaryFolder scratch;
  EXPECT_REGRADE_ERROR(VideoWriter(scratch / "none/a.mp4", 64, 64, 24), ExitCode::kResources,
                       "");
}

TEST(VideoFile, WhatIsNoVideoCountsAsNone) {
  const TemporaryFolder scratch;
  WriteText(scratch / "a.mp4", "text");
  EXPECT_EQ(CountVideoFrames(scratch / "a.mp4"), -1);
}

}  // namespace
}  // namespace regrade
