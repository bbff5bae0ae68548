#include "evaluate/tables.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::Contains;

ConsistencyReport SomeReport() {
  ConsistencyReport report;
  report.mode = "lai2018";
  report.flow = "dis-medium";
  ConsistencyRow row;
  row.sequence = "styled";
  row.gap = 1;
  row.pairs = 49;
  row.undefined_pairs = 2;
  row.tc_psnr_mean_db = 31.234;
  row.tc_psnr_interval_db = Interval{30.876, 31.5};
  row.tc_psnr_of_mean_db = std::numeric_limits<double>::infinity();
  row.coverage = 0.8125;
  row.tc_psnr_unmasked_mean_db = 30.104;
  report.rows.push_back(row);
  row.gap = 5;
  row.tc_psnr_mean_db.reset();
  row.tc_psnr_interval_db.reset();
  row.why = "no pair of frames is 5 apart";
  row.perfect_pairs = 3;
  row.pairs_above_8bit_floor = 7;
  row.low_coverage_pairs = 4;
  report.rows.push_back(row);
  return report;
}

TEST(Tables, FormsForPasting) {
  const std::string markdown = FormatTables(SomeReport(), {}, {.form = "markdown"});
  EXPECT_TRUE(Contains(markdown, "\n| sequence | gap | pairs |")) << markdown;
  EXPECT_TRUE(Contains(
      markdown, "| styled | 1 | 49 | 2 | 31.23 | [30.88, 31.50] | inf | 30.10 | 81.2 % |"));
  const std::string csv = FormatTables(SomeReport(), {}, {.form = "csv"});
  EXPECT_TRUE(Contains(csv, "\nstyled,1,49,2,31.23,\"[30.88, 31.50]\",inf,30.10,81.2 %\n"))
      << csv;
  EXPECT_TRUE(Contains(csv, "\n# styled, gap 5: no pair"));
  const std::string latex = FormatTables(SomeReport(), {}, {.form = "latex"});
  EXPECT_TRUE(
      Contains(latex,
               "styled & 1 & 49 & 2 & 31.23 & [30.88, 31.50] & $\\infty$ & 30.10 & 81.2 \\% "
               "\\\\\n"))
      << latex;
  EXPECT_TRUE(Contains(latex, "\\begin{tabular}{lrrrrrrrr}\n\\toprule\n"));
}

TEST(Tables, ASequenceWithACommaIsQuotedInCsv) {
  ConsistencyReport report = SomeReport();
  report.rows[0].sequence = "mine, \"new\"";
  EXPECT_TRUE(
      Contains(FormatTables(report, {}, {.form = "csv"}), "\n\"mine, \"\"new\"\"\",1,49"));
}

TEST(Tables, MetricsUndefinedOnesAndInfinity) {
  FidelityRow fidelity;
  fidelity.sequence = "styled";
  fidelity.psnr_to_2d_db = 27.456;
  const std::string text = FormatTables(SomeReport(), {fidelity});
  EXPECT_TRUE(Contains(text, "31.23"));
  EXPECT_TRUE(Contains(text, "[30.88, 31.50]"));
  EXPECT_TRUE(Contains(text, " inf"));
  EXPECT_TRUE(Contains(text, "81.2 %"));
  EXPECT_TRUE(Contains(text, "27.46"));
  EXPECT_TRUE(Contains(text, "styled, gap 5: no pair of frames is 5 apart"));
  EXPECT_TRUE(Contains(text, "3 identical pair(s)"));
  EXPECT_TRUE(Contains(text, "4 pair(s) above 58.9 dB"));
  EXPECT_TRUE(Contains(text, "4 pair(s) with few comparable pixels"));
  EXPECT_FALSE(Contains(text, "nan"));
  EXPECT_FALSE(Contains(text, "was not measured"));
}

// What a paper takes: one float with caption and label, whose columns all have numbers.
TEST(Tables, LatexIsATableWithCaptionAndLabel) {
  ConsistencyReport report = SomeReport();
  report.frames = 50;
  report.width = 640;
  report.height = 480;
  for (ConsistencyRow& row : report.rows) {
    row.tc_psnr_interval_db.reset();
    row.tc_psnr_of_mean_db.reset();
  }
  report.rows[0].tc_psnr_mean_db = -1.5;
  TableContext context{.form = "latex", .protocol = "liprf", .version = "9.8.7"};
  context.labels["styled"] = "[a]_{b} & \\c^~<50%>|";
  context.remarks = {"control_linear_map: left out, no style"};
  const std::string latex = FormatTables(report, {}, context);
  const size_t caption = latex.find("\\caption{");
  const std::string said = latex.substr(caption, latex.find('\n', caption) - caption);
  for (const char* part : {"liprf", "dis-medium", "50 frames of 640 x 480 px", "9.8.7"})
    EXPECT_TRUE(Contains(said, part)) << said;
  EXPECT_TRUE(Contains(latex, "\n\\label{tab:consistency}\n")) << latex;
  EXPECT_TRUE(Contains(latex, "\n\\label{tab:fidelity}\n")) << latex;
  // Interval and mean error have no value in any row.
  EXPECT_TRUE(Contains(latex, "\\begin{tabular}{lrrrrrr}\n")) << latex;
  EXPECT_TRUE(
      Contains(latex,
               "\n{}[a]\\_\\{b\\} \\& \\textbackslash{}c\\textasciicircum{}"
               "\\textasciitilde{}\\textless{}50\\%\\textgreater{}\\textbar{} & 1 & 49 & 2 & "
               "$-$1.50 & 30.10 & "))
      << latex;
  EXPECT_TRUE(Contains(latex, "\n% control_linear_map: left out, no style\n")) << latex;
}

TEST(Tables, DifferencesHaveColumnsOfTheirOwn) {
  ConsistencyReport report = SomeReport();
  report.compared_with = "styled";
  report.rows[1].sequence = "styled_2";
  report.rows[1].difference = PairedDifference{44, -0.254, Interval{-0.5, -0.1}};
  TableContext context{.form = "csv"};
  context.labels = {{"styled", "Ours"}, {"styled_2", "X"}};
  const std::string csv = FormatTables(report, {}, context);
  EXPECT_TRUE(Contains(csv, "mean of dB,95 %,minus Ours,95 %,dB of mean")) << csv;
  EXPECT_TRUE(Contains(csv, "\nOurs,1,49,2,31.23,\"[30.88, 31.50]\",-,-,inf")) << csv;
  EXPECT_TRUE(Contains(csv, "\nX,5,49,2,-,-,-0.25,\"[-0.50, -0.10]\",inf")) << csv;
}

TEST(Tables, ConsistencyIsNeverAlone) {
  const std::string text = FormatTables(SomeReport(), {});
  EXPECT_TRUE(Contains(text, "Fidelity"));
  EXPECT_TRUE(Contains(text, "styled: fidelity was not measured"));
}

}  // namespace
}  // namespace regrade
