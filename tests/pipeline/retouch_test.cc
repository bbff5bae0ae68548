// One retouched photo of a synthetic capture against the exact truth of its grade.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/images/image_file.h"
#include "tests/support/edit_truth.h"
#include "tests/support/record_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/spawn.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::EditErrors;
using testing::EditTruth;
using testing::ProgramOutcome;
using testing::ReadText;
using testing::TemporaryFolder;

ProgramOutcome Regrade(const std::vector<std::string>& arguments) {
  return testing::RunProgram(REGRADE_PROGRAM, arguments);
}

constexpr int kViews = 16, kEdited = 6;

std::string Frame(const std::string& folder, int i) {
  return folder + Format("/000%02d.png", i);
}

std::vector<Image> Frames(const std::string& folder) {
  std::vector<Image> frames;
  for (int i = 0; i < kViews; ++i) frames.push_back(ReadImage(Frame(folder, i)));
  return frames;
}

// TC-PSNR of neighbouring views: "styled,1,15,0,MEAN,..." of the table.
double Consistency(const std::string& frames, const std::string& reference) {
  const ProgramOutcome outcome = Regrade({"evaluate", "--frames", frames, "--reference",
                                          reference, "--gaps", "1", "--table", "csv"});
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  const size_t row = outcome.text.find("\nstyled,1,");
  int pairs = 0, undefined = 0;
  double mean = 0;
  EXPECT_EQ(std::sscanf(outcome.text.c_str() + std::min(row, outcome.text.size()),
                        "\nstyled,1,%d,%d,%lf", &pairs, &undefined, &mean),
            3)
      << outcome.text;
  return mean;
}

// Of the squared error between the best linear map and the ceiling, the least squares of all
// voxels to all true views, 90 % is to be removed for a global edit and 75 % for a local one.
// Beside the linear map's error the ceiling is 0.084 for the global grade and below 0.006 for
// the others (tests/benchmarks/retouch_benchmark.cc).
TEST(Retouch, TheSceneFollowsEachEditAsItsExactTruth) {
  const TemporaryFolder folder;
  const auto capture = [&](const std::string& grade) { return folder / ("s_" + grade); };
  for (const std::string grade : {"global", "local", "object", "vignette"})
    ASSERT_EQ(Regrade({"synth", capture(grade), "--views", "16", "--size", "192x144", "--grade",
                       grade})
                  .code,
              0);
  std::vector<std::string> reconstruct{"reconstruct", capture("global") + "/truth",
                                       "--out",       folder / "out",
                                       "--device",    "cpu",
                                       "--holdout",   "0"};
  for (const std::string flag :
       {"--photo-size", "192", "--fit-resolutions", "96", "--fit-steps", "1200",
        "--style-steps", "200", "--film-seconds", "0.125", "--fps", "24", "--film-size", "64",
        "--threads", "2", "--tracks", "given"})
    reconstruct.push_back(flag);
  ProgramOutcome outcome = Regrade(reconstruct);
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const auto retouch = [&](const std::string& grade, const std::string& edited) {
    return Regrade({"retouch", folder / "out", "--photo", "00006", "--edited", edited, "--name",
                    grade, "--until", "render"});
  };
  const auto style = [&](const std::string& grade) { return folder / ("out/styles/" + grade); };
  using testing::Computed;
  using testing::RecordBound;
  for (const std::string grade : {"global", "local", "object", "vignette"}) {
    outcome = retouch(grade, capture(grade) + "/truth/graded/00006.png");
    ASSERT_EQ(outcome.code, 0) << outcome.text;
    EXPECT_TRUE(fs::exists(style(grade) + "/edit.cube"));
    const bool local = grade == "local" || grade == "object";
    EXPECT_NE(outcome.text.find(local ? "depends on the place" : "one map of colours"),
              std::string::npos)
        << outcome.text;
    if (grade == "vignette") continue;
    const EditTruth truth(grade, Frames(style(grade) + "/frames/source"), kEdited);
    const EditErrors errors = truth.ErrorsOf(Frames(style(grade) + "/frames/styled"));
    const double left = errors.inside / truth.ErrorsOf(truth.ByLinearMap()).inside;
    const double most = local ? 0.25 : 1 - 0.9 * (1 - 0.084), outside = 255 * errors.outside;
    EXPECT_LE(left, RecordBound(grade + " edit: share of the best linear map's squared error "
                                        "left inside the region",
                                Computed::kFloat, left, most));
    EXPECT_LE(outside, RecordBound(grade + " edit: change 10 pixels and more outside, of 255",
                                   Computed::kFloat, outside, 1));
    EXPECT_EQ(fs::exists(style(grade) + "/layers/00006.png"), local);
    // Consistency, beside the graded unedited renders'.
    const std::string graded = folder / ("graded_" + grade);
    fs::create_directories(graded);
    for (int i = 0; i < kViews; ++i)
      WritePng8(Frame(graded, i), truth.graded()[static_cast<size_t>(i)]);
    const std::string reference = style(grade) + "/frames/source";
    const double lost = Consistency(graded, reference) -
                        Consistency(style(grade) + "/frames/styled", reference);
    EXPECT_LE(lost, RecordBound(grade + " edit: TC-PSNR below the graded renders', dB",
                                Computed::kFloat, lost, 0.3));
  }
  // The vignette belongs to the picture: the scene is that of the grade without it.
  const std::vector<Image> with = Frames(style("vignette") + "/frames/styled"),
                           without = Frames(style("global") + "/frames/styled");
  double moved = 0, count = 0;
  for (size_t i = 0; i < with.size(); ++i)
    for (size_t k = 0; k < with[i].pixels.size(); ++k, ++count)
      moved += std::abs(double{with[i].pixels[k]} - double{without[i].pixels[k]});
  moved *= 255 / count;
  EXPECT_LE(moved, RecordBound("vignette: mean change of the scene's colours, of 255",
                               Computed::kFloat, moved, 1));

  // Again with another edit: the style of that name is made again; another style's is not.
  outcome = Regrade({"retouch", folder / "out", "--photo", "nothere", "--edited",
                     capture("global") + "/truth/graded/00006.png", "--name", "global"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.text.find("is no photo of the capture"), std::string::npos);
  outcome = retouch("global", capture("global") + "/images/00009.png");
  EXPECT_EQ(outcome.code, 3) << outcome.text;
  EXPECT_NE(outcome.text.find("photo"), std::string::npos) << outcome.text;
}

TEST(Retouch, ALocalEditIsLearnedFromItsPhotoAlone) {
  const TemporaryFolder folder;
  ASSERT_EQ(
      Regrade({"synth", folder / "s", "--views", "6", "--size", "160x120", "--grade", "local"})
          .code,
      0);
  std::vector<std::string> reconstruct{"reconstruct",  folder / "s/truth", "--out",
                                       folder / "out", "--device",         "cpu"};
  for (const std::string& flag : testing::TinyFlags()) reconstruct.push_back(flag);
  reconstruct[reconstruct.size() - testing::TinyFlags().size() + 1] = "160";
  ASSERT_EQ(Regrade(reconstruct).code, 0);
  const ProgramOutcome outcome =
      Regrade({"retouch", folder / "out", "--photo", "00002.png", "--edited",
               folder / "s/truth/graded/00002.png", "--name", "dark"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("depends on the place"), std::string::npos) << outcome.text;
  EXPECT_TRUE(fs::exists(folder / "out/styles/dark/retouched/00002.png"));
  EXPECT_NE(ReadText(folder / "out/styles/dark/retouch.json").find("\"local\""),
            std::string::npos);
}

TEST(Retouch, ARenderIsWrittenToBeEdited) {
  const TemporaryFolder folder;
  ASSERT_EQ(Regrade({"synth", folder / "s", "--views", "5", "--size", "96x72"}).code, 0);
  std::vector<std::string> reconstruct{"reconstruct",  folder / "s/truth", "--out",
                                       folder / "out", "--device",         "cpu"};
  for (const std::string& flag : testing::TinyFlags()) reconstruct.push_back(flag);
  ASSERT_EQ(Regrade(reconstruct).code, 0);
  const auto retouch = [&](std::vector<std::string> more) {
    std::vector<std::string> all{"retouch", folder / "out", "--photo", "00002"};
    all.insert(all.end(), more.begin(), more.end());
    return Regrade(all);
  };
  const std::string render = folder / "out/retouch/00002.tif", edited = folder / "edited.png";
  ProgramOutcome outcome = retouch({});
  EXPECT_EQ(outcome.code, 2);  // a photo's edit is not written by anybody but its owner
  WritePng16(edited, Image(96, 72));
  outcome = retouch({"--from", "render", "--edited", edited});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.text.find("not written yet"), std::string::npos) << outcome.text;
  outcome = retouch({"--from", "render"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("00002.tif"), std::string::npos) << outcome.text;
  EXPECT_FALSE(fs::exists(folder / "out/styles"));
  DecodeLimits limits;
  limits.min_side = 1;
  Image picture = DecodePhoto(render, limits).image;
  ASSERT_EQ(picture.width, 96);
  // More than 256 levels: 16 bits came through.
  std::vector<float> levels = picture.pixels;
  std::sort(levels.begin(), levels.end());
  EXPECT_GT(std::unique(levels.begin(), levels.end()) - levels.begin(), 1000);
  // Half as light. Seen from the render it is one map of colours, although this small fit is
  // far from its photo.
  for (float& v : picture.pixels) v *= 0.5f;
  WritePng16(edited, picture);
  outcome = retouch({"--from", "render", "--edited", edited, "--name", "dim"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("one map of colours"), std::string::npos) << outcome.text;
  EXPECT_TRUE(fs::exists(folder / "out/styles/dim/edit.cube"));
  EXPECT_NE(ReadText(folder / "out/styles/dim/retouch.json").find("\"render\""),
            std::string::npos);
}

}  // namespace
}  // namespace regrade
