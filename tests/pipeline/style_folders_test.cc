// Names of styles' folders: safe as file names, and one for each picture.
#include "pipeline/workspace/style_folders.h"

#include <gtest/gtest.h>

#include "pipeline/workspace/stage_record.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;
using testing::WriteText;

TEST(StyleFolders, NamesAreSafeAndKeptApartByContent) {
  EXPECT_EQ(SafeStyleName("/a/b/Sunset 3.JPG"), "Sunset_3");
  EXPECT_EQ(SafeStyleName("caf\xc3\xa9.png"), "caf_");
  EXPECT_EQ(SafeStyleName("..hidden.png"), "hidden");
  EXPECT_EQ(SafeStyleName("/x/.."), "style");
  EXPECT_EQ(SafeStyleName(std::string(300, 'x') + ".png").size(), 80u);

  const TemporaryFolder folder;
  for (const char* name : {"a/x.png", "b/x.png", "c/x.png"}) WriteText(folder / name, name);
  const std::string out = folder / "out";
  std::vector<NamedStyle> named = NameStyles(out, {folder / "a/x.png", folder / "b/x.png"}, "");
  EXPECT_EQ(named[0].name, "x");
  EXPECT_EQ(named[1].name, "x-2");
  // In a folder that has b's picture as "x", a's gets the other name, whatever comes first.
  WriteText(out + "/styles/x/run.json",
            "{\"picture_hash\": \"" + HashFile(folder / "b/x.png") + "\"}");
  named = NameStyles(out, {folder / "a/x.png", folder / "b/x.png"}, "");
  EXPECT_EQ(named[0].name, "x-2");
  EXPECT_EQ(named[1].name, "x");
  EXPECT_REGRADE_ERROR(NameStyles(out, {folder / "c/x.png"}, "x"), ExitCode::kUsage,
                       "another picture");
  EXPECT_EQ(NameStyles(out, {folder / "b/x.png"}, "x")[0].name, "x");
  for (const char* unsafe : {"../x", ".x", "a b", "a/b"})
    EXPECT_REGRADE_ERROR(NameStyles(out, {folder / "c/x.png"}, unsafe), ExitCode::kUsage,
                         "not allowed");
  EXPECT_REGRADE_ERROR(NameStyles(out, {folder / "a/x.png", folder / "a/x.png"}, ""),
                       ExitCode::kUsage, "twice");
  EXPECT_REGRADE_ERROR(NameStyles(out, {folder / "a/x.png", folder / "b/x.png"}, "y"),
                       ExitCode::kUsage, "several");
}

}  // namespace
}  // namespace regrade
