#include "pipeline/stages/command_stylizer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
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
  EXPECT_REGRADE_ERROR(Styled(Script("kill -9 $$")), ExitCode::kExternalProgram, "signal 9");
}

TEST(CommandStylizer, F55_HalfAPictureIsRefused) {
  EXPECT_REGRADE_ERROR(Styled(Script("head -c 60 \"$1\" > \"$2\"")), ExitCode::kExternalProgram,
                       "truncated");
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
