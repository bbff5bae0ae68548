#include "evaluate/tables.h"

#include <gtest/gtest.h>

#include <limits>

namespace regrade {
namespace {

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

bool Has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(Tables, FormsForPasting) {
  const std::string markdown = FormatTables(SomeReport(), {}, "markdown");
  EXPECT_TRUE(Has(markdown, "\n| sequence | gap | pairs |")) << markdown;
  EXPECT_TRUE(Has(markdown, "| styled | 1 | 49 | 2 | 31.23 | 30.88..31.50 | inf | 81.2 % |"));
  const std::string csv = FormatTables(SomeReport(), {}, "csv");
  EXPECT_TRUE(Has(csv, "\nstyled,1,49,2,31.23,30.88..31.50,inf,81.2 %\n")) << csv;
  EXPECT_TRUE(Has(csv, "\n# styled, gap 5: no pair"));
  const std::string latex = FormatTables(SomeReport(), {}, "latex");
  EXPECT_TRUE(Has(latex, "styled & 1 & 49 & 2 & 31.23 & 30.88..31.50 & inf & 81.2 \\% \\\\\n"))
      << latex;
  EXPECT_TRUE(Has(latex, "\\begin{tabular}{lrrrrrrr}\n\\toprule\n"));
}

TEST(Tables, ASequenceWithACommaIsQuotedInCsv) {
  ConsistencyReport report = SomeReport();
  report.rows[0].sequence = "mine, \"new\"";
  EXPECT_TRUE(Has(FormatTables(report, {}, "csv"), "\n\"mine, \"\"new\"\"\",1,49"));
}

TEST(Tables, MetricsUndefinedOnesAndInfinity) {
  FidelityRow fidelity;
  fidelity.sequence = "styled";
  fidelity.psnr_to_2d_db = 27.456;
  const std::string text = FormatTables(SomeReport(), {fidelity});
  EXPECT_TRUE(Has(text, "31.23"));
  EXPECT_TRUE(Has(text, "30.88..31.50"));
  EXPECT_TRUE(Has(text, " inf"));
  EXPECT_TRUE(Has(text, "81.2 %"));
  EXPECT_TRUE(Has(text, "27.46"));
  EXPECT_TRUE(Has(text, "styled, gap 5: no pair of frames is 5 apart"));
  EXPECT_TRUE(Has(text, "3 identical pair(s)"));
  EXPECT_TRUE(Has(text, "4 pair(s) above 58.9 dB"));
  EXPECT_TRUE(Has(text, "4 pair(s) with few comparable pixels"));
  EXPECT_FALSE(Has(text, "nan"));
  EXPECT_FALSE(Has(text, "was not measured"));
}

TEST(Tables, ConsistencyIsNeverAlone) {
  const std::string text = FormatTables(SomeReport(), {});
  EXPECT_TRUE(Has(text, "Fidelity"));
  EXPECT_TRUE(Has(text, "styled: fidelity was not measured"));
}

}  // namespace
}  // namespace regrade
