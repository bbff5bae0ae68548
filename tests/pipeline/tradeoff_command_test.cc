// regrade tradeoff with a tiny capture: its outputs and continuation.
#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/files/json_file.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

using testing::ProgramOutcome;
using testing::Regrade;
using testing::TemporaryFolder;

TEST(TradeoffCommand, MeasuresAndContinues) {
  const TemporaryFolder folder;
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  testing::WriteCapture(folder / "s", 6, "96x72");
  const auto tradeoff = [&](const std::vector<std::string>& more) {
    return Regrade(testing::Joined(
                       {"tradeoff", folder / "s/truth", "--style", style, "--out", folder / "t",
                        "--parameters", "fit-steps,style-min-weight,flow,ray-stop", "--presets",
                        "none", "--effects", "view-dependence=off,exposure=off"},
                       testing::TinyFlags("voxels")),
                   more);
  };
  ProgramOutcome outcome = tradeoff({"--dry-run", "--budget", "1e-9"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "flow: flow dis-ultrafast, about");
  EXPECT_SAYS(outcome, "the least useful --budget is about");
  EXPECT_FALSE(std::filesystem::exists(folder / "t"));

  // The base run counts: it spends this budget, and what budget is useful was said before it.
  outcome = tradeoff({"--repeats", "1", "--budget", "1e-9", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "the budget is spent: 16 measurements");
  EXPECT_FALSE(std::filesystem::exists(folder / "t/measurements.json"));
  const size_t said = outcome.text.find("{\"event\":\"budget\"");
  ASSERT_LT(said, outcome.text.find("\"stage_begin\"")) << outcome.text;
  const std::string line = outcome.text.substr(said, outcome.text.find('\n', said) - said);
  const JsonValue budget = ParseJson(line, "stdout");
  EXPECT_GT(budget.At("base_seconds").AsDouble(), 0);
  EXPECT_NEAR(60 * budget.At("least_minutes").AsDouble(),
              budget.At("base_seconds").AsDouble() + budget.At("first_seconds").AsDouble(),
              1e-9);

  // With the base run there, the same budget is for one measurement.
  outcome = tradeoff({"--repeats", "1", "--budget", "1e-9"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "the budget is spent: 15 measurements");
  const size_t left =
      ReadJsonFile(folder / "t/measurements.json").At("measurements").AsArray().size();
  EXPECT_EQ(left, 1u);

  outcome = tradeoff({"--repeats", "1"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  const JsonValue result = ReadJsonFile(folder / "t/tradeoff.json");
  // Four bases, three values of the steps, two weights, four flows and three ends of a ray.
  EXPECT_EQ(result.At("schema").AsInt(), 2);
  EXPECT_EQ(result.At("costs").AsArray().size(), 4u + 3 + 2 + 4 + 3);
  EXPECT_EQ(testing::CountOf(outcome.text, "] "), 16 - left);  // measurements are not repeated
  int on_pareto_front = 0;
  for (const JsonValue& row : result.At("costs").AsArray()) {
    EXPECT_TRUE(row.At("accuracy").IsNumber()) << DumpJson(row, -1);
    EXPECT_GT(row.At("cpu_seconds").AsDouble(), 0);
    on_pareto_front += row.At("on_pareto_front").AsBool();
  }
  EXPECT_GE(on_pareto_front, 4);  // at least one per benchmark
  EXPECT_EQ(testing::CountOf(testing::ReadText(folder / "t/tradeoff.csv"), "\n"), 17u);
  EXPECT_NE(testing::ReadText(folder / "t/tradeoff.html").find("accuracy over time, flow"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "t/work"));
  outcome = tradeoff({"--repeats", "1"});
  EXPECT_EQ(testing::CountOf(outcome.text, "] "), 0u) << outcome.text;

  // In the folder of a run the table becomes part of its report; a damaged one or one of
  // another schema is omitted with a warning.
  const auto page = [&] {
    return testing::ReadText(folder / "t/base/styles/style_sunset/report.html");
  };
  testing::WriteText(folder / "t/base/tradeoff/tradeoff.json",
                     "{\"schema\": 1, \"costs\": [{}]}");
  outcome = Regrade({"evaluate", folder / "t/base"});
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_SAYS(outcome, "the report does without tradeoff/tradeoff.json");
  EXPECT_SAYS(outcome, "schema 1");
  EXPECT_EQ(page().find("Accuracy and cost"), std::string::npos);
  testing::WriteText(folder / "t/base/tradeoff/tradeoff.json",
                     testing::ReadText(folder / "t/tradeoff.json"));
  EXPECT_EQ(Regrade({"evaluate", folder / "t/base"}).code, 0);
  EXPECT_NE(page().find("Accuracy and cost"), std::string::npos);
}

TEST(TradeoffCommand, VariesFitsOfSplats) {
  const TemporaryFolder folder;
  testing::WriteCapture(folder / "s", 6, "96x72");
  ProgramOutcome outcome =
      Regrade({"tradeoff", folder / "s/truth", "--out", folder / "t", "--parameters",
               "splat-steps,flow", "--style", testing::SourceDir() + "/assets/style_sunset.png",
               "--presets", "none", "--repeats", "1"},
              testing::TinyFlags());
  ASSERT_EQ(outcome.code, 0) << outcome.text;
  // Two bases, three values of the steps and four flows.
  const JsonValue result = ReadJsonFile(folder / "t/tradeoff.json");
  EXPECT_EQ(result.At("costs").AsArray().size(), 2u + 3 + 4);
  for (const JsonValue& row : result.At("costs").AsArray())
    EXPECT_TRUE(row.At("accuracy").IsNumber()) << DumpJson(row, -1);
}

TEST(TradeoffCommand, RefusesInvalidArguments) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "photos");
  EXPECT_EQ(
      Regrade({"tradeoff", folder / "photos", "--out", folder / "t", "--parameters", "stepz"})
          .code,
      2);
  EXPECT_EQ(
      Regrade({"tradeoff", folder / "photos", "--out", folder / "t", "--presets", "best,x"})
          .code,
      2);
  EXPECT_EQ(Regrade({"tradeoff", folder / "photos"}).code, 2);
  EXPECT_FALSE(std::filesystem::exists(folder / "t"));
}

}  // namespace
}  // namespace regrade
