#include "pipeline/stages/command_stylizer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "pipeline/images/image_file.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;

Image Photo() {
  Image image(24, 16);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<float>(i * 53 % 256) / 255.0f;
  return image;
}

Image Styled(const std::string& command, const std::string& style = "style.png",
             double limit_s = 20) {
  return MakeCommandStylizer(command, style, limit_s)->Stylize(Photo(), 4);
}

TEST(CommandStylizer, F55_CommandsAreSplitByOurOwnRule) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(SplitCommand("  a b\t\"c d\" 'e \"f' g\"h i\"j \"\" "),
            (Words{"a", "b", "c d", "e \"f", "gh ij", ""}));
  // Nothing that a shell would see.
  EXPECT_EQ(SplitCommand("a $HOME *.png ; b|c \\ `d` ~"),
            (Words{"a", "$HOME", "*.png", ";", "b|c", "\\", "`d`", "~"}));
  EXPECT_EQ(SplitCommand(""), Words{});
  EXPECT_REGRADE_ERROR(SplitCommand("a \"b"), ExitCode::kUsage, "stays open");
}

TEST(CommandStylizer, F55_APictureGoesThroughAProgram) {
  EXPECT_EQ(Styled("cp {input} {output}").pixels, Photo().pixels);
  // The style goes in as one word, whatever is in its name, and is not looked at again.
  const testing::TemporaryFolder folder;
  const std::string style = folder / "my {input} $(style);.png";
  Image picture = Photo();
  std::reverse(picture.pixels.begin(), picture.pixels.end());
  WritePng8(style, picture);
  EXPECT_EQ(Styled("env A={input} cp -- {style} {output}", style).pixels, picture.pixels);
}

TEST(CommandStylizer, F55_PlaceholdersAreNeeded) {
  for (const char* command :
       {"cp {input} out.png", "cp in.png {output}", "\"\" {input} {output}"})
    EXPECT_REGRADE_ERROR(MakeCommandStylizer(command, "s", 1), ExitCode::kUsage,
                         "style command");
}

TEST(CommandStylizer, F55_WhatGoesWrongIsSaidWithTheProgramsWords) {
  const testing::TemporaryFolder folder;
  const ExitCode code = ExitCode::kExternalProgram;
  EXPECT_REGRADE_ERROR(Styled("/nowhere/restyle {input} {output}"), code, "/nowhere/restyle");
  EXPECT_REGRADE_ERROR(Styled("cp /nowhere/picture.png {output} {input}x/y"), code, "view 4");
  EXPECT_REGRADE_ERROR(Styled("ls /nowhere {input} {output}"), code, "No such file");
  EXPECT_REGRADE_ERROR(Styled("true {input} {output}"), code, "left no picture");
  testing::WriteText(folder / "text.png", "no picture");
  EXPECT_REGRADE_ERROR(Styled("env A={input} cp {style} {output}", folder / "text.png"), code,
                       "no picture");
  WritePng8(folder / "other.png", Image(24, 24));
  EXPECT_REGRADE_ERROR(Styled("env A={input} cp {style} {output}", folder / "other.png"), code,
                       "24 x 24");
}

TEST(CommandStylizer, F55_AProgramThatHangsIsEnded) {
  EXPECT_REGRADE_ERROR(Styled("env A={input} B={output} sleep 20", "s", 0.3),
                       ExitCode::kExternalProgram, "style-command-limit");
}

// What a program does is said in sh; {input} and {output} are its $1 and $2.
std::string Script(const std::string& script) {
  return "/bin/sh -c '" + script + "' x {input} {output}";
}

TEST(CommandStylizer, F55_AProgramThatDiesIsNamedWithItsSignal) {
  for (const int number : {6, 8, 9, 11, 13, 15})
    EXPECT_REGRADE_ERROR(Styled(Script("kill -" + std::to_string(number) + " $$")),
                         ExitCode::kExternalProgram, "signal " + std::to_string(number));
}

TEST(CommandStylizer, F55_AFloodIsDrained) {
  const std::string flood =
      "i=0; while [ $i -lt 3000 ]; do printf %01000d 7; i=$((i+1)); done; ";
  EXPECT_EQ(Styled(Script(flood + "cp \"$1\" \"$2\"")).pixels, Photo().pixels);
}

TEST(CommandStylizer, F55_HalfAPictureIsRefused) {
  EXPECT_REGRADE_ERROR(Styled(Script("head -c 60 \"$1\" > \"$2\"")), ExitCode::kExternalProgram,
                       "truncated");
}

TEST(CommandStylizer, F55_IgnoredSigtermIsFollowedBySigkill) {
  // The program would go on for 20 s.
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_REGRADE_ERROR(
      Styled(Script("trap \"\" TERM; for i in $(seq 400); do sleep 0.05; done"), "s", 0.3),
      ExitCode::kExternalProgram, "style-command-limit");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(12));
}

TEST(CommandStylizer, F55_GrandchildrenEndWithTheirParent) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(
      Styled(Script("sleep 60 & echo $! > " + (folder / "pid") + "; cp \"$1\" \"$2\"")).pixels,
      Photo().pixels);
  const pid_t grandchild = std::stoi(testing::ReadText(folder / "pid"));
  const std::string stat = "/proc/" + std::to_string(grandchild) + "/stat";
  std::string number, name, state = "Z";  // a zombie until init takes it
  for (int i = 0; i < 100 && fs::exists(stat); ++i, usleep(10000)) {
    std::ifstream(stat) >> number >> name >> state;
    if (state == "Z") break;
  }
  EXPECT_EQ(state, "Z");
}

TEST(CommandStylizer, LeavesNothingBehind) {
  const testing::TemporaryFolder folder;
  ::setenv("TMPDIR", folder.path().c_str(), 1);
  Styled("cp {input} {output}");
  EXPECT_REGRADE_ERROR(Styled("false {input} {output}"), ExitCode::kExternalProgram, "failed");
  ::unsetenv("TMPDIR");
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace regrade
