// Cost tables: variants, stored measurements, and the Pareto front.
#include "pipeline/study/cost_table.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "pipeline/report/cost_rows.h"
#include "pipeline/study/duration_estimate.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using testing::TemporaryFolder;

Measurement Of(const Variant& variant, double cpu, double accuracy, int repeat = 0) {
  return {variant.benchmark, variant.parameter, variant.value, repeat, 0.6 * cpu, cpu,
          accuracy};
}

Variant FitVariant(const std::string& parameter, const std::string& value, bool end = false) {
  return {"fit", parameter, value, JsonValue::Object(), end};
}

const CostRow& RowOf(const std::vector<CostRow>& rows, const std::string& setting) {
  return *std::find_if(rows.begin(), rows.end(),
                       [&](const CostRow& row) { return row.setting == setting; });
}

TEST(Parameters, ValuesFollowTheBase) {
  RunSettings base;
  base.fit.steps = {10, 20};
  base.fit.resolutions = {16, 24};
  const std::vector<Variant> variants =
      VariantsOf(base, {{"fit-steps", "sh-degree"}, false, true, {}});
  std::vector<std::string> names;
  for (const Variant& variant : variants)
    names.push_back(variant.parameter + "=" + variant.value);
  // A quarter, half and twice the base's steps, without the base's own value. Other benchmarks
  // have no chosen parameter, thus no base.
  EXPECT_EQ(names, (std::vector<std::string>{"=", "fit-steps=3,5", "fit-steps=5,10",
                                             "fit-steps=20,40", "sh-degree=0", "sh-degree=1"}));
  EXPECT_TRUE(variants[3].accurate_end);
  EXPECT_FALSE(variants[5].accurate_end);  // the base is the accurate end
  EXPECT_REGRADE_ERROR(VariantsOf(base, {{"fit-stepz"}, false, true, {}}), ExitCode::kUsage,
                       "fit-stepz");
}

TEST(Parameters, EveryOptionIsAnOptionOfARun) {
  RunSettings base;
  OptionSet options;
  base.Bind(&options);
  for (const Variant& variant : VariantsOf(base, {{}, true, true, {"draft", "paper"}}))
    if (variant.benchmark != "render") {
      RunSettings settings = base;
      OptionSet set;
      settings.Bind(&set);
      set.ApplyConfig(variant.options, "here");  // throws for an unknown name
      EXPECT_EQ(DumpJson(set.Values(), -1) == DumpJson(options.Values(), -1),
                variant.parameter.empty())
          << variant.parameter << " " << variant.value;
    }
}

TEST(CostTable, MediansSpreadsAndErrorsAgainstTheAccurateEnd) {
  const std::vector<Variant> variants = {FitVariant("", ""), FitVariant("fit-steps", "5"),
                                         FitVariant("fit-steps", "20", true),
                                         FitVariant("sh-degree", "1")};
  std::vector<Measurement> measured = {Of(variants[1], 4, 24, 0), Of(variants[1], 9, 25, 1),
                                       Of(variants[1], 5, 24.5, 2)};
  measured.push_back(Of(variants[0], 10, 26));
  measured.push_back(Of(variants[2], 20, 27));
  measured.push_back(Of(variants[3], 8, 25.75));
  const std::vector<CostRow> rows = CostTable(variants, measured, "preset draft");
  ASSERT_EQ(rows.size(), 4u);
  const CostRow& few = RowOf(rows, "5");
  EXPECT_EQ(*few.cpu_seconds.value, 5);
  EXPECT_EQ(*few.cpu_spread.value, 2.5);
  EXPECT_EQ(*few.accuracy.value, 24.5);
  EXPECT_EQ(*few.error.value, 2.5);                // relative to 20 steps
  EXPECT_EQ(*RowOf(rows, "1").error.value, 0.25);  // relative to the base
  EXPECT_FALSE(RowOf(rows, "preset draft").error.value);
  EXPECT_NE(CostTableText(rows).find("* preset draft"), std::string::npos);
  EXPECT_NE(CostTableCsv(rows).find("fit,\"fit-steps\",\"5\",3,3.000000,1.500000,5.000000"),
            std::string::npos)
      << CostTableCsv(rows);
}

TEST(CostTable, TheParetoFrontHasTheVariantsThatNoneBeats) {
  const std::vector<Variant> variants = {FitVariant("", ""), FitVariant("a", "good"),
                                         FitVariant("a", "bad"), FitVariant("a", "twin")};
  std::vector<Measurement> measured;
  for (int repeat = 0; repeat < 2; ++repeat) {
    const double noise = repeat;
    measured.push_back(Of(variants[0], 10 + noise, 26, repeat));
    measured.push_back(Of(variants[1], 5 + noise, 27, repeat));
    measured.push_back(Of(variants[2], 7 + noise, 25, repeat));
    measured.push_back(Of(variants[3], 5.5 + noise, 27, repeat));
  }
  std::vector<CostRow> rows = CostTable(variants, measured, "the base");
  EXPECT_TRUE(RowOf(rows, "good").on_pareto_front);
  EXPECT_EQ(RowOf(rows, "the base").dominated_by, "a good");
  EXPECT_EQ(RowOf(rows, "bad").dominated_by, "a good");
  // A difference of half a second is within the spreads: beaten, but not dominated.
  EXPECT_FALSE(RowOf(rows, "twin").on_pareto_front);
  EXPECT_EQ(RowOf(rows, "twin").dominated_by, "");
  // If less is better, the front is reversed.
  for (const Variant& variant : variants) EXPECT_EQ(variant.benchmark, "fit");
  std::vector<Variant> flow = variants;
  for (Variant& variant : flow) variant.benchmark = "flow";
  for (Measurement& m : measured) m.benchmark = "flow";
  rows = CostTable(flow, measured, "the base");
  EXPECT_TRUE(RowOf(rows, "bad").on_pareto_front);
  EXPECT_TRUE(RowOf(rows, "good").on_pareto_front);  // the fastest
  EXPECT_EQ(RowOf(rows, "the base").dominated_by, "a bad");
  // Single measurements have no spread.
  std::erase_if(measured, [](const Measurement& m) { return m.repeat > 0; });
  EXPECT_EQ(RowOf(CostTable(flow, measured, "the base"), "the base").dominated_by, "");
}

TEST(MeasurementStore, KeepsMeasurementsOfTheSameFingerprint) {
  const TemporaryFolder folder;
  const std::string path = folder / "measurements.json";
  const Variant variant = FitVariant("fit-steps", "5");
  {
    MeasurementStore store(path, "one");
    Measurement m = Of(variant, 4, 24, 1);
    m.work["rays"] = int64_t{1} << 40;
    store.Add(m);
  }
  const MeasurementStore again(path, "one");
  ASSERT_NE(again.Find(variant, 1), nullptr);
  EXPECT_EQ(again.Find(variant, 1)->accuracy, 24);
  EXPECT_EQ(again.Find(variant, 1)->work.At("rays").AsInt(), int64_t{1} << 40);
  EXPECT_EQ(again.Find(variant, 0), nullptr);
  EXPECT_TRUE(MeasurementStore(path, "other").all().empty());
  testing::WriteText(path, R"({"schema": 1, "fingerprint": "one", "measurements": []})");
  EXPECT_REGRADE_ERROR(MeasurementStore(path, "one"), ExitCode::kInput, "schema 1");
  testing::WriteText(path, R"({"schema": 2, "fingerprint": "one", "measurements": [{}]})");
  EXPECT_REGRADE_ERROR(MeasurementStore(path, "one"), ExitCode::kInput, "measurements.json");
}

TEST(CostTable, FitsOfSplatsVaryWhatSplatsHave) {
  RunSettings settings;
  settings.scene.field = "splats";
  for (const Variant& variant : VariantsOf(settings, {}))
    EXPECT_FALSE(variant.parameter.starts_with("fit-") || variant.benchmark == "render")
        << variant.parameter;
}

TEST(DurationEstimate, ImprovesWithTheFirstMeasurement) {
  RunSettings base;
  const Variant own = FitVariant("", "");
  Variant twice = FitVariant("fit-steps", "twice", true);
  JsonValue::Array steps;
  for (const int count : base.fit.steps) steps.push_back(2 * count);
  twice.options["fit-steps"] = steps;
  DurationEstimate estimate(base, {}, [](const RunSettings&) {
    return FitPlace{.pixels = 4 * 768 * 768, .photos = 4};
  });
  EXPECT_NEAR(estimate.Seconds(twice), 2 * estimate.Seconds(own), 1e-6 * estimate.Seconds(own));
  estimate.Add({"fit", "", "", 0, 10, 15, 26});
  EXPECT_NEAR(estimate.Seconds(own), 10, 1e-9);
  EXPECT_NEAR(estimate.Seconds(twice), 20, 1e-6);
}

}  // namespace
}  // namespace regrade
