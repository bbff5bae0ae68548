#include "pipeline/commands/frame_folder.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::ReadText;
using testing::TemporaryFolder;
using testing::WriteText;

// A folder of frames of the given names and size.
FrameFolder Open(const std::string& folder, const std::vector<std::string>& names,
                 int width = 16) {
  for (const std::string& name : names)
    WriteText(folder + "/" + name, EncodePng8(Image(width, 12, 3)));
  return OpenFrameFolder(folder);
}

// The error on opening the folder; "" if there is none.
std::string ErrorOf(const std::string& folder, const std::vector<std::string>& names) {
  try {
    Open(folder, names);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kInput);
    EXPECT_FALSE(error.where().empty());
    return error.what();
  }
  return "";
}

bool Has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(FrameFolder, NaturalOrderAndEvenNumbers) {
  const TemporaryFolder folder;
  EXPECT_EQ(Open(folder / "a", {"f10.png", "f9.png", "f11.png"}).names,
            (std::vector<std::string>{"f9.png", "f10.png", "f11.png"}));
  EXPECT_EQ(Open(folder / "b", {"00000.png", "00002.png", "00004.png"}).Source().count, 3);
  EXPECT_EQ(ErrorOf(folder / "c", {"left.png", "right.png", "top.png"}), "");
  EXPECT_EQ(ErrorOf(folder / "d", {"a_1.png", "b_7.png", "c_99.png"}), "");
  EXPECT_EQ(ErrorOf(folder / "e", {"take 2, 1.png", "take 2, 2.png"}), "");
}

TEST(FrameFolder, AMissingNumberIsNamed) {
  const TemporaryFolder folder;
  const std::string inside = ErrorOf(folder / "a", {"00000.png", "00001.png", "00003.png"});
  EXPECT_TRUE(Has(inside, "frame 00002 is missing between 00001.png and 00003.png")) << inside;
  const std::string first = ErrorOf(folder / "b", {"8.png", "10.png", "11.png"});
  EXPECT_TRUE(Has(first, "frame 9 is missing")) << first;
}

TEST(FrameFolder, ANumberTwiceIsNamed) {
  const TemporaryFolder folder;
  const std::string text = ErrorOf(folder / "a", {"1.png", "01.png", "2.png"});
  EXPECT_TRUE(Has(text, "1.png")) << text;
  EXPECT_TRUE(Has(text, "have the same number")) << text;
}

TEST(FrameFolder, MixedSizesNameTheFileAndBothSizes) {
  const TemporaryFolder folder;
  WriteText(folder / "00002.png", EncodePng8(Image(20, 12, 3)));
  const std::string text = ErrorOf(folder.path(), {"00000.png", "00001.png"});
  EXPECT_TRUE(Has(text, "00002.png")) << text;
  EXPECT_TRUE(Has(text, "20 x 12 px")) << text;
  EXPECT_TRUE(Has(text, "16 x 12 px")) << text;
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
    EXPECT_TRUE(Has(ErrorOf(here, names), "00002.png")) << number;
  }
  std::filesystem::create_directories(folder / "linked");
  std::filesystem::create_symlink("/nowhere", folder / "linked/00002.png");
  EXPECT_TRUE(Has(ErrorOf(folder / "linked", names), "00002.png"));
}

TEST(FrameFolder, NoFramesAndNoFolder) {
  const TemporaryFolder folder;
  EXPECT_TRUE(Has(ErrorOf(folder.path(), {}), "no frames"));
  EXPECT_NE(ErrorOf(folder / "none", {}), "");
}

TEST(FrameFolder, DifferentNumbersOfFramesNameTheOdd) {
  const TemporaryFolder folder;
  const FrameFolder reference = Open(folder / "r", {"00000.png", "00001.png", "00002.png"});
  const FrameFolder fewer = Open(folder / "s", {"x1.png", "x2.png"});
  EXPECT_NO_THROW(CheckSameFrames(reference, reference));
  try {
    CheckSameFrames(reference, fewer);
    FAIL() << "3 frames and 2 frames were accepted";
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_TRUE(Has(text, "2 frames, the reference has 3")) << text;
    EXPECT_TRUE(Has(text, "00000.png of " + (folder / "r") + " has no counterpart")) << text;
  }
}

}  // namespace
}  // namespace regrade
