// Fields that are refined in blocks, by runs of the program.
#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/fields/field_file.h"
#include "pipeline/files/json_file.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::Regrade;
using testing::TemporaryFolder;

class Refine : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::WriteCapture(folder_ / "capture", 12, "96x72");
    std::vector<std::string> run = {"reconstruct",   folder_ / "capture/truth",
                                    "--out",         folder_ / "o",
                                    "--device",      "cpu",
                                    "--holdout",     "4",
                                    "--seed",        "3",
                                    "--reproducible"};
    for (const std::string& flag : testing::TinyFlags("splats")) run.push_back(flag);
    testing::Said(run);
  }

  ProgramOutcome RefineWith(const std::vector<std::string>& more,
                            const std::string& of = "o") const {
    return Regrade(
        {"refine", folder_ / of, "--blocks", "3", "--splats", "4", "--splat-steps", "90"},
        more);
  }

  JsonValue Refined(const std::string& of = "o") const {
    return ReadJsonFile(folder_ / (of + "/.regrade/stages/reconstruct.json"))
        .At("metrics")
        .At("refined");
  }

  TemporaryFolder folder_;
};

TEST_F(Refine, PartsGiveTheBytesOfOneProcess) {
  fs::copy(folder_ / "o", folder_ / "p", fs::copy_options::recursive);
  const std::string coarse = ReadText(folder_ / "o/field.npz");
  const ProgramOutcome whole = RefineWith({});
  ASSERT_EQ(whole.code, 0) << whole.text;
  EXPECT_EQ(Refined().At("blocks").AsInt(), 3);
  EXPECT_GT(Refined().At("psnr_before_db").AsDouble(), 5);
  EXPECT_NE(ReadText(folder_ / "o/field.npz"), coarse);
  EXPECT_FALSE(fs::exists(folder_ / "o/blocks"));

  // What waits for neighbours is made when the part is run again, and what is there is kept.
  for (int round = 0; round < 3; ++round)
    for (const char* part : {"1/2", "2/2"}) {
      const ProgramOutcome some = RefineWith({"--part", part}, "p");
      ASSERT_EQ(some.code, 0) << some.text;
    }
  EXPECT_EQ(ReadText(folder_ / "p/field.npz"), coarse);
  const ProgramOutcome joined = RefineWith({"--part", "join"}, "p");
  ASSERT_EQ(joined.code, 0) << joined.text;
  EXPECT_EQ(ReadText(folder_ / "p/field.npz"), ReadText(folder_ / "o/field.npz"));
  // Given again, it does nothing.
  const std::string refined = ReadText(folder_ / "p/field.npz");
  for (const char* again : {"--part=join", "--verbose"})
    EXPECT_EQ(RefineWith({again}, "p").code, 0) << again;
  EXPECT_EQ(ReadText(folder_ / "p/field.npz"), refined);
  // The stage counts as done, with the field that is there now.
  testing::Said({"reconstruct", folder_ / "capture/truth", "--out", folder_ / "p", "--config",
                 folder_ / "o/run.json", "--dry-run"});
}

TEST_F(Refine, AJoinNamesWhatIsMissing) {
  ASSERT_EQ(RefineWith({"--part", "1/3"}).code, 0);
  const std::string coarse = ReadText(folder_ / "o/field.npz");
  const ProgramOutcome joined = RefineWith({"--part", "join"});
  EXPECT_EQ(joined.code, static_cast<int>(ExitCode::kInput));
  EXPECT_SAYS(joined, "of 3 and");
  // Of other settings all are missing, and which differ is said.
  const ProgramOutcome other = Regrade({"refine", folder_ / "o", "--blocks", "3", "--splats",
                                        "5", "--splat-steps", "90", "--part", "join"});
  EXPECT_EQ(other.code, static_cast<int>(ExitCode::kInput));
  EXPECT_SAYS(other, "was 4.0, now 5.0");
  EXPECT_EQ(ReadText(folder_ / "o/field.npz"), coarse);
}

TEST_F(Refine, AJoinThatWasInterruptedIsRepeated) {
  for (int round = 0; round < 3; ++round) ASSERT_EQ(RefineWith({"--part", "1/1"}).code, 0);
  // The field is replaced, and that is not noted yet.
  fs::remove(folder_ / "o/field.npz");
  for (const auto& entry : fs::directory_iterator(folder_ / "o/blocks"))
    fs::copy_file(entry.path() / "00001.npz", folder_ / "o/field.npz");
  EXPECT_EQ(Regrade({"refine", folder_ / "o", "--blocks", "2", "--part", "1/2"}).code,
            static_cast<int>(ExitCode::kInput));
  const ProgramOutcome joined = RefineWith({"--part", "join"});
  ASSERT_EQ(joined.code, 0) << joined.text;
  EXPECT_EQ(Refined().At("blocks").AsInt(), 3);
}

TEST_F(Refine, WhatCannotBeIsRefused) {
  EXPECT_EQ(RefineWith({"--part", "4/3"}).code, static_cast<int>(ExitCode::kUsage));
  EXPECT_EQ(RefineWith({"--part", "joined"}).code, static_cast<int>(ExitCode::kUsage));
  EXPECT_EQ(RefineWith({"--holdout", "0"}).code, static_cast<int>(ExitCode::kUsage));
  EXPECT_EQ(RefineWith({}, "nowhere").code, static_cast<int>(ExitCode::kInput));
  EXPECT_FALSE(fs::exists(folder_ / "nowhere"));
  EXPECT_EQ(RefineWith({"--dry-run"}).code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "o/blocks"));
}

}  // namespace
}  // namespace regrade
