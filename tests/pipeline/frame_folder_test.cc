#include "pipeline/commands/frame_folder.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/commands/frame_numbers.h"
#include "pipeline/commands/frame_pairing.h"
#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::Contains;
using testing::TemporaryFolder;
using testing::WriteText;

// A folder of frames of the given names and size.
FrameFolder Open(const std::string& folder, const std::vector<std::string>& names,
                 int width = 16) {
  for (const std::string& name : names)
    WriteText(folder + "/" + name, EncodePng8(Image(width, 12, 3)));
  return OpenFrameFolder(folder);
}

// The error on opening the folder.
std::string ErrorOf(const std::string& folder, const std::vector<std::string>& names) {
  const Error error = testing::ErrorFrom([&] { Open(folder, names); });
  EXPECT_EQ(error.code(), ExitCode::kInput);
  EXPECT_FALSE(error.where().empty());
  return error.what();
}

TEST(FrameFolder, NaturalOrderAndEvenNumbers) {
  const TemporaryFolder folder;
  EXPECT_EQ(Open(folder / "a", {"f10.png", "f9.png", "f11.png"}).names,
            (std::vector<std::string>{"f9.png", "f10.png", "f11.png"}));
  EXPECT_EQ(Open(folder / "b", {"00000.png", "00002.png", "00004.png"}).Source().count, 3);
  Open(folder / "c", {"left.png", "right.png", "top.png"});
  Open(folder / "d", {"a_1.png", "b_7.png", "c_99.png"});
  Open(folder / "e", {"take 2, 1.png", "take 2, 2.png"});
}

TEST(FrameFolder, AMissingNumberIsNamed) {
  const TemporaryFolder folder;
  const std::string inside = ErrorOf(folder / "a", {"00000.png", "00001.png", "00003.png"});
  EXPECT_TRUE(Contains(inside, "frame 00002 is missing between 00001.png and 00003.png"))
      << inside;
  const std::string first = ErrorOf(folder / "b", {"8.png", "10.png", "11.png"});
  EXPECT_TRUE(Contains(first, "frame 9 is missing")) << first;
}

TEST(FrameFolder, ANumberTwiceIsNamed) {
  const TemporaryFolder folder;
  const std::string text = ErrorOf(folder / "a", {"1.png", "01.png", "2.png"});
  EXPECT_TRUE(Contains(text, "1.png")) << text;
  EXPECT_TRUE(Contains(text, "have the same number")) << text;
}

TEST(FrameFolder, MixedSizesNameTheFileAndBothSizes) {
  const TemporaryFolder folder;
  WriteText(folder / "00002.png", EncodePng8(Image(20, 12, 3)));
  const std::string text = ErrorOf(folder.path(), {"00000.png", "00001.png"});
  EXPECT_TRUE(Contains(text, "00002.png")) << text;
  EXPECT_TRUE(Contains(text, "20 x 12 px")) << text;
  EXPECT_TRUE(Contains(text, "16 x 12 px")) << text;
}

TEST(FrameFolder, DamagedFramesAreNamedBeforeWorkBegins) {
  const TemporaryFolder folder;
  const std::vector<std::string> names{"00000.png", "00001.png"};
  Image noise(64, 64, 3);
  for (size_t i = 0; i < noise.pixels.size(); ++i)
    noise.pixels[i] = static_cast<float>(i * 7919 % 256) / 255;
  const std::string png = EncodePng8(noise);
  std::string flipped = png;
  flipped[png.size() / 2] = static_cast<char>(flipped[png.size() / 2] ^ 0x40);
  const std::string jpeg = EncodeJpeg(noise, 90);
  int number = 0;
  for (const std::string& bytes :
       {std::string(), std::string("no picture"), png.substr(0, png.size() / 2), flipped,
        jpeg.substr(0, jpeg.size() / 2)}) {
    const std::string here = folder / std::to_string(number++);
    WriteText(here + "/00002.png", bytes);
    EXPECT_TRUE(Contains(ErrorOf(here, names), "00002.png")) << number;
  }
  std::filesystem::create_directories(folder / "linked");
  std::filesystem::create_symlink("/nowhere", folder / "linked/00002.png");
  EXPECT_TRUE(Contains(ErrorOf(folder / "linked", names), "00002.png"));
}

TEST(FrameFolder, NoFramesAndNoFolder) {
  const TemporaryFolder folder;
  EXPECT_TRUE(Contains(ErrorOf(folder.path(), {}), "no frames"));
  ErrorOf(folder / "none", {});
}

std::vector<int64_t> Numbers(const std::vector<std::string>& names) {
  std::vector<int64_t> numbers;
  for (const FrameNumber& number : FrameNumbers(names)) numbers.push_back(number.number);
  return numbers;
}

TEST(FrameNumbers, AreTheDigitsThatDiffer) {
  using List = std::vector<int64_t>;
  EXPECT_EQ(Numbers({"scene2_0001.png", "scene2_0002.png"}), (List{1, 2}));
  EXPECT_EQ(Numbers({"0001_scene2.png", "0002_scene2.jpg"}), (List{1, 2}));
  EXPECT_EQ(Numbers({"f9.png", "f010.png"}), (List{9, 10}));
  EXPECT_EQ(Numbers({"frame.0003", "frame.0004"}), (List{3, 4}));
  EXPECT_EQ(Numbers({"0001_t0.04.png", "0002_t0.08.png"}), (List{1, 2}));  // the first
  EXPECT_EQ(Numbers({"cam1_08.png", "cam1_09.png", "cam2_01.png"}), List());
  EXPECT_EQ(Numbers({"left.png", "right.png"}), List());
  EXPECT_EQ(Numbers({"a1.png", "b2.png"}), List());
  EXPECT_EQ(Numbers({"1403636579763555584.png", "1403636579813555456.png"}),
            List());  // too long
}

// Two or more folders after pairing, the reference first.
struct Paired {
  std::vector<FrameFolder> folders;
  std::vector<FramePairing> pairings;
};

Paired PairOf(const TemporaryFolder& folder,
              const std::vector<std::vector<std::string>>& names) {
  static int number = 0;
  Paired paired;
  for (const auto& some : names)
    paired.folders.push_back(Open(folder / std::to_string(++number), some));
  std::vector<FrameFolder*> sequences;
  for (size_t i = 1; i < names.size(); ++i) sequences.push_back(&paired.folders[i]);
  paired.pairings = PairFolders(&paired.folders[0], sequences);
  return paired;
}

TEST(FramePairing, ByNumberWhereNumbersOverlap) {
  using Names = std::vector<std::string>;
  const TemporaryFolder folder;
  const Paired shifted =
      PairOf(folder, {{"0.png", "1.png", "2.png"}, {"x_0001.png", "x_0002.png", "x_0003.png"}});
  EXPECT_EQ(shifted.pairings[0].by, "number");
  EXPECT_EQ(shifted.folders[0].names, (Names{"1.png", "2.png"}));
  EXPECT_EQ(shifted.folders[1].names, (Names{"x_0001.png", "x_0002.png"}));
  EXPECT_EQ(shifted.folders[0].places, (std::vector<int>{1, 2}));
  EXPECT_EQ(shifted.folders[0].Source().count, 2);
  EXPECT_EQ(shifted.pairings[0].left_out, Names{"x_0003.png"});
  EXPECT_EQ(shifted.pairings[0].reference_left_out, Names{"0.png"});
  EXPECT_FALSE(shifted.pairings[0].notice.empty());
  // Every second frame of the reference, and one number fewer than it.
  EXPECT_EQ(PairOf(folder, {{"0.png", "1.png", "2.png", "3.png", "4.png"},
                            {"00.png", "02.png", "04.png"}})
                .folders[0]
                .names,
            (Names{"0.png", "2.png", "4.png"}));
  // The same numbers, whatever stands around them, are worth no notice.
  const Paired same = PairOf(
      folder, {{"8.png", "9.png", "10.png"}, {"cam2_08.png", "cam2_09.png", "cam2_10.png"}});
  EXPECT_EQ(same.pairings[0].by, "number");
  EXPECT_EQ(same.pairings[0].notice, "");
  EXPECT_EQ(same.folders[0].Source().count, 3);
}

TEST(FramePairing, ByNameOrInOrderWithANotice) {
  using Names = std::vector<std::string>;
  const TemporaryFolder folder;
  const Paired names = PairOf(
      folder, {{"left.png", "mid.png", "right.png"}, {"mid.jpg", "right.jpg", "top.jpg"}});
  EXPECT_EQ(names.pairings[0].by, "name");
  EXPECT_EQ(names.folders[1].names, (Names{"mid.jpg", "right.jpg"}));
  EXPECT_EQ(names.pairings[0].left_out, Names{"top.jpg"});
  EXPECT_EQ(PairOf(folder, {{"a.png", "b.png"}, {"a.jpg", "b.jpg"}}).pairings[0].notice, "");
  for (const Names& other :
       {Names{"100.png", "101.png"}, Names{"a.png", "b.png"}, Names{"1.png", "2.png"}}) {
    const Paired order = PairOf(folder, {{"0.png", "1.png"}, other});  // at most one in common
    EXPECT_EQ(order.pairings[0].by, "order");
    EXPECT_FALSE(order.pairings[0].notice.empty());
    EXPECT_EQ(order.folders[1].names, other);
  }
}

TEST(FramePairing, AllFoldersHaveTheSameMoments) {
  using Names = std::vector<std::string>;
  const TemporaryFolder folder;
  const Paired three = PairOf(folder, {{"0.png", "1.png", "2.png", "3.png"},
                                       {"1.png", "2.png", "3.png"},
                                       {"0.png", "1.png", "2.png"}});
  for (const FrameFolder& each : three.folders)
    EXPECT_EQ(each.names, (Names{"1.png", "2.png"}));
}

TEST(FramePairing, WhatCannotBePairedIsNamed) {
  const TemporaryFolder folder;
  EXPECT_REGRADE_ERROR(PairOf(folder, {{"0.png", "1.png", "2.png"}, {"a.png", "b.png"}}),
                       ExitCode::kInput, "2 frames, the reference has 3");
  EXPECT_REGRADE_ERROR(
      PairOf(folder, {{"a.png", "b.png", "c.png", "d.png"}, {"a.png", "b.png", "d.png"}}),
      ExitCode::kInput, "c.png of");
  EXPECT_REGRADE_ERROR(
      PairOf(folder,
             {{"0.png", "1.png", "2.png", "3.png"}, {"0.png", "1.png"}, {"2.png", "3.png"}}),
      ExitCode::kInput, "no frame has a counterpart");
  FrameFolder reference = Open(folder / "wide", {"0.png", "1.png"}, 32),
              small = Open(folder / "small", {"0.png", "1.png"});
  EXPECT_REGRADE_ERROR(PairFolders(&reference, {&small}), ExitCode::kInput,
                       "16 x 12 px, the reference has 32 x 12 px");
}

}  // namespace
}  // namespace regrade
