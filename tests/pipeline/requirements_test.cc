// --require: what is understood, what is refused before work, and which bounds hold.
#include "pipeline/report/requirements.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "pipeline/report/records.h"
#include "pipeline/report/requirement_results.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

RunReport Report() {
  ConsistencyMetrics near{.sequence = "styled", .gap = 1}, far{.sequence = "styled", .gap = 5};
  near.tc_psnr_mean_db = 31.5;
  far.tc_psnr_mean_db = Metric::Undefined("too few frames");
  ConsistencyMetrics film{.sequence = "path_styled", .gap = 1};
  film.tc_psnr_mean_db = Metric(std::numeric_limits<double>::infinity());
  FidelityRow fidelity{.sequence = "styled"};
  fidelity.structure = 0.97;
  fidelity.psnr_to_2d_db = std::nan("");
  RunReport report;
  report.evaluation = {{near, far, film}, {fidelity}, {}};
  report.stages.reconstruct.emplace();
  report.stages.reconstruct->psnr_heldout_db = 28.25;
  report.stages.reconstruct->voxels = 1000;
  return report;
}

// The sentences of those that do not hold.
std::vector<std::string> Failed(const std::string& text, const RunReport& report,
                                const std::vector<int>& gaps) {
  std::vector<std::string> failed;
  for (const CheckedRequirement& checked :
       CheckRequirements(ParseRequirements(text, gaps), report))
    if (!checked.holds) failed.push_back(checked.Sentence());
  return failed;
}

std::vector<std::string> Failed(const std::string& text) {
  return Failed(text, Report(), {1, 5});
}

TEST(Requirements, HoldOrNameValueAndBound) {
  EXPECT_TRUE(Failed("").empty());
  EXPECT_TRUE(Failed("styled:tc-psnr:1>=31.5,styled:tc-psnr:1<=31.5").empty());
  EXPECT_TRUE(Failed("styled:structure>=0.97,reconstruct:psnr-heldout>=28").empty());
  EXPECT_TRUE(Failed("styled:tc_psnr_mean_db:1>=30,reconstruct:voxels<=1e3").empty());
  const std::vector<std::string> failed =
      Failed("styled:tc-psnr:1>=32,styled:structure>=0.9,reconstruct:psnr-heldout<=28");
  ASSERT_EQ(failed.size(), 2u);
  EXPECT_EQ(failed[0], "styled:tc-psnr:1>=32: measured 31.5");
  EXPECT_EQ(failed[1], "reconstruct:psnr-heldout<=28: measured 28.25");
}

// A missing stage, row or number holds nothing; no error at all is better than any bound.
TEST(Requirements, WithoutANumber) {
  EXPECT_EQ(Failed("styled:tc-psnr:5>=1")[0],
            "styled:tc-psnr:5>=1: tc_psnr of styled at gap 5 has no value (too few frames)");
  EXPECT_EQ(Failed("styled:psnr-to-2d>=1")[0],
            "styled:psnr-to-2d>=1: psnr_to_2d of styled has no value (not a number)");
  for (const char* text : {"source:tc-psnr:1>=1", "stylize:bound<=9", "styled:lpips-to-2d<=1",
                           "stylize:loss-balance<=1"})
    EXPECT_EQ(Failed(text).size(), 1u) << text;
  EXPECT_TRUE(Failed("path-styled:tc-psnr:1>=99").empty());
  EXPECT_EQ(Failed("path-styled:tc-psnr:1<=99").size(), 1u);
}

// A sentence names the metric and what the report has in its place; no brackets are empty.
TEST(Requirements, WithoutANumberTheSentenceSaysWhatIsThere) {
  EXPECT_EQ(Failed("source:tc-psnr:1>=1")[0],
            "source:tc-psnr:1>=1: tc_psnr of source at gap 1 has no value (measured: styled at "
            "gap 1, styled at gap 5, path_styled at gap 1)");
  EXPECT_EQ(Failed("source:structure>=1")[0],
            "source:structure>=1: structure of source has no value (measured: styled)");
  EXPECT_EQ(Failed("stylize:bound<=9")[0],
            "stylize:bound<=9: bound of stylize has no value (measured: reconstruct)");
  RunReport report;
  const auto sentence = [&report](const char* text) { return Failed(text, report, {1})[0]; };
  EXPECT_EQ(sentence("styled:structure>=1"),
            "styled:structure>=1: structure of styled has no value (nothing was measured)");
  ConsistencyMetrics silent{.sequence = "styled"};
  silent.coverage = Metric::Undefined("");
  report.evaluation.consistency.push_back(silent);
  EXPECT_EQ(
      sentence("styled:coverage:1>=1"),
      "styled:coverage:1>=1: coverage of styled at gap 1 has no value, and the report does "
      "not say why");
}

TEST(Requirements, FramesThatDoNotChangeAreAboveEveryBound) {
  ConsistencyReport still;
  ConsistencyRow row;
  row.sequence = "styled";
  row.gap = 1;
  row.pairs = row.perfect_pairs = 3;
  row.tc_psnr_of_mean_db = std::numeric_limits<double>::infinity();
  row.why = "all compared pairs are identical: infinite";
  still.rows = {row};
  RunReport report;
  report.evaluation = MetricsOf(still, {});
  const auto failed = [&](const std::string& text) { return Failed(text, report, {1}); };
  EXPECT_TRUE(failed("styled:tc-psnr:1>=30,styled:tc-psnr-of-mean:1>=30").empty());
  EXPECT_EQ(failed("styled:tc-psnr:1<=30").size(), 1u);
  // Without a pixel to compare there is no number, which holds no bound.
  still.rows[0].perfect_pairs = 0;
  still.rows[0].undefined_pairs = 3;
  report.evaluation = MetricsOf(still, {});
  EXPECT_EQ(failed("styled:tc-psnr:1>=30").size(), 1u);
}

TEST(Requirements, AreRefusedBeforeWork) {
  for (const auto& [text, part] : std::vector<std::pair<std::string, std::string>>{
           {"styled:tc-psnr:1", "no bound"},
           {"styled:tc-psnr:1>=", "not a number"},
           {"styled:tc-psnr:1>=3x", "not a number"},
           {"styled:tc-psnr:1>=nan", "not a number"},
           {"styled:tc-psnr:1>=inf", "not a number"},
           {"styled:tc-psnr:x>=3", "not a whole number"},
           {"styled:tc-psnr>=3", "gap is missing"},
           {"styled:structure:1>=3", "no gap"},
           {"reconstruct:voxels:1>=3", "no gap"},
           {"styled:tc-psnr:2>=3", "gap 2 is not measured"},
           {"style:tc-psnr:1>=3", "no sequence or stage style"},
           {"styled:beauty>=3", "no metric beauty of styled"},
           {"reconstruct:tc-psnr>=3", "no metric tc_psnr of reconstruct"},
           {"styled>=3", "sequence or stage and a metric"},
           {"styled:tc-psnr:1>=3,", "no bound"}})
    EXPECT_REGRADE_ERROR(ParseRequirements(text, {1, 5}), ExitCode::kUsage, part);
}

TEST(Requirements, FailWithAStatusOfTheirOwn) {
  Console console(false);
  FinishRequirements({}, "", &console);
  const auto checked = CheckRequirements(
      ParseRequirements("styled:structure>=0.99,styled:tc-psnr:1>=40", {1}), Report(), "a");
  EXPECT_REGRADE_ERROR(FinishRequirements(checked, "", &console), ExitCode::kRequirement,
                       "0.97; a: styled:tc-psnr:1>=40: measured 31.5");
}

// One test case for each requirement; names are data, not markup.
TEST(Requirements, JUnitHasATestCaseForEach) {
  const testing::TemporaryFolder folder;
  const auto requirements = ParseRequirements(
      "styled:tc-psnr:1>=30,styled:structure>=0.98,styled:tc-psnr:5>=1", {1, 5});
  const auto checked = CheckRequirements(requirements, Report(), "a<b>&\"c\"\x01");
  const std::string xml = JUnitXml(checked);
  const auto count = [&](const std::string& part) {
    int found = 0;
    for (size_t at = xml.find(part); at != std::string::npos; at = xml.find(part, at + 1))
      ++found;
    return found;
  };
  EXPECT_EQ(count("<testcase "), 3);
  EXPECT_EQ(count("</testcase>"), 3);
  EXPECT_EQ(count("<failure "), 2);
  EXPECT_EQ(count("tests=\"3\" failures=\"2\""), 2);
  EXPECT_EQ(count("name=\"styled:tc-psnr:1&gt;=30\""), 1);
  EXPECT_EQ(count("classname=\"regrade.a&lt;b&gt;&amp;&quot;c&quot;\\x01\""), 3);
  EXPECT_EQ(count("measured 31.5, required at least 30"), 1);
  EXPECT_EQ(count("message=\"measured 0.97, required at least 0.98\""), 1);
  EXPECT_EQ(count("no value (too few frames), required at least 1"), 1);
  for (const char c : xml) EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= ' ');

  Console console(false);
  const std::string path = folder / "junit.xml";
  EXPECT_REGRADE_ERROR(FinishRequirements(checked, path, &console), ExitCode::kRequirement,
                       "structure");
  EXPECT_EQ(testing::ReadText(path), xml);  // in spite of the error
  BeginJUnit(path);
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_REGRADE_ERROR(BeginJUnit(folder / "none/junit.xml"), ExitCode::kInput, "folder");
  EXPECT_REGRADE_ERROR(BeginJUnit(folder.path()), ExitCode::kInput, "folder");
}

}  // namespace
}  // namespace regrade
