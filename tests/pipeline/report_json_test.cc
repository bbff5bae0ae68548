// report.json: the keys of schema 1, in its order, and nulls that say why.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "pipeline/report/json.h"

namespace regrade {
namespace {

using Keys = std::vector<std::string>;

Keys KeysOf(const JsonValue& object) {
  Keys keys;
  for (const auto& [key, value] : object.AsObject()) keys.push_back(key);
  return keys;
}

// A report in which every figure is measured.
RunReport FullReport() {
  RunReport report;
  report.version = "0.1.0";
  report.command = {"regrade", "run"};
  report.seed = std::numeric_limits<uint64_t>::max();
  report.peak_memory_mb = 900;
  report.photos = PhotosReport{
      2, 1, 1, {{"a.jpg", PhotoState::kUsed, ""}, {"\xFF.jpg", PhotoState::kSkipped, "text"}}};
  report.effects = {{"ndc", false, "corner rays", 0.41, 0.9}};
  report.stages.pose = PoseStageReport{1, 0.9, 12775, 1};
  report.stages.reconstruct = ReconstructReport{2, 1000, 29, 26.5, 0.8, {"a.jpg"}};
  report.stages.style_2d = Style2dReport{3, "mkl"};
  report.stages.stylize = StylizeReport{4, 300, 1.5, 1.9, 1.2, 27, 25, 26};
  report.stages.stylize->local_lipschitz_max = 1.3;
  report.stages.stylize->local_lipschitz_of_map = 1.1;
  report.stages.stylize->local_lipschitz_along_coefficients = 1.2;
  report.stages.stylize->local_lipschitz_along_position = 0.1;
  report.stages.render = RenderReport{5, 60, 12};
  report.stages.evaluate = EvaluateReport{6, "dis-medium", "lai2018"};
  report.consistency = {{"styled", 1, 49, 0, 29.8, 29.5, 0.8, {}, 29.1, 30.4, ""}};
  report.fidelity = {{"styled", 27, 0.19, 0.2, 12, 13, 0.01}};
  return report;
}

TEST(ReportJson, SecondsOfTracksWhereTheyWereLookedFor) {
  RunReport report = FullReport();
  report.stages.pose->tracks_seconds = 12.5;
  report.stages.pose->tracks_cpu_seconds = 20;
  const JsonValue pose = ReportJson(report).At("stages").At("pose");
  EXPECT_EQ(KeysOf(pose), (Keys{"seconds", "reprojection_px", "points", "models_found",
                                "tracks_seconds", "tracks_cpu_seconds"}));
  EXPECT_EQ(pose.At("tracks_seconds").AsDouble(), 12.5);
  EXPECT_EQ(pose.At("tracks_cpu_seconds").AsDouble(), 20);
}

TEST(ReportJson, HasTheKeysOfSchema1InOrder) {
  const JsonValue json = ReportJson(FullReport());
  EXPECT_EQ(KeysOf(json),
            (Keys{"schema", "regrade", "command", "preset", "device", "seed", "seconds",
                  "peak_memory_mb", "photos", "effects", "stages", "consistency", "fidelity"}));
  EXPECT_EQ(json.At("schema").AsInt(), 1);
  EXPECT_EQ(KeysOf(json.At("photos")), (Keys{"given", "used", "registered", "statuses"}));
  EXPECT_EQ(KeysOf(json.At("photos").At("statuses").AsArray()[0]),
            (Keys{"file", "status", "why"}));
  EXPECT_EQ(KeysOf(json.At("effects").AsArray()[0]),
            (Keys{"name", "on", "evidence", "value", "threshold"}));
  const JsonValue& stages = json.At("stages");
  EXPECT_EQ(KeysOf(stages),
            (Keys{"pose", "reconstruct", "style_2d", "stylize", "render", "evaluate"}));
  EXPECT_EQ(KeysOf(stages.At("pose")),
            (Keys{"seconds", "reprojection_px", "points", "models_found"}));
  EXPECT_EQ(KeysOf(stages.At("reconstruct")),
            (Keys{"seconds", "voxels", "psnr_train_db", "psnr_heldout_db", "ssim_heldout",
                  "heldout"}));
  EXPECT_EQ(KeysOf(stages.At("style_2d")), (Keys{"seconds", "method"}));
  EXPECT_EQ(KeysOf(stages.At("stylize")),
            (Keys{"seconds", "steps", "k_est", "bound", "local_lipschitz_sampled",
                  "psnr_to_2d_db", "psnr_to_2d_photos_db", "linear_map_psnr_to_2d_db",
                  "local_lipschitz_max", "local_lipschitz_of_map",
                  "local_lipschitz_along_coefficients", "local_lipschitz_along_position"}));
  EXPECT_EQ(KeysOf(stages.At("render")), (Keys{"seconds", "frames", "frames_per_second"}));
  EXPECT_EQ(KeysOf(stages.At("evaluate")), (Keys{"seconds", "flow", "mask"}));
  EXPECT_EQ(KeysOf(json.At("consistency").AsArray()[0]),
            (Keys{"sequence", "gap", "pairs", "undefined_pairs", "tc_psnr_mean_db",
                  "tc_psnr_of_mean_db", "tc_psnr_low_db", "tc_psnr_high_db", "coverage"}));
  EXPECT_EQ(KeysOf(json.At("fidelity").AsArray()[0]),
            (Keys{"sequence", "psnr_to_2d_db", "hue_std", "hue_std_2d", "chroma", "chroma_2d",
                  "sliced_wasserstein_to_style"}));
}

TEST(ReportJson, UndefinedMetricsAreNullWithAWhy) {
  RunReport report = FullReport();
  report.stages.reconstruct->psnr_heldout_db = Metric::Undefined("holdout is 0");
  report.consistency[0].tc_psnr_mean_db = std::numeric_limits<double>::quiet_NaN();
  report.consistency[0].tc_psnr_pairs_db = {30.0, Metric(), 31.0};
  const JsonValue json = ReportJson(report);
  const JsonValue& stage = json.At("stages").At("reconstruct");
  EXPECT_TRUE(stage.At("psnr_heldout_db").IsNull());
  EXPECT_EQ(stage.At("psnr_heldout_db_why").AsString(), "holdout is 0");
  EXPECT_EQ(stage.Find("psnr_train_db_why"), nullptr);
  const JsonValue& row = json.At("consistency").AsArray()[0];
  EXPECT_TRUE(row.At("tc_psnr_mean_db").IsNull());
  EXPECT_FALSE(row.At("tc_psnr_mean_db_why").AsString().empty());
  EXPECT_TRUE(row.At("tc_psnr_pairs_db").AsArray()[1].IsNull());
  EXPECT_EQ(row.At("tc_psnr_pairs_db").AsArray().size(), 3u);
}

TEST(ReportJson, SurvivesATripThroughText) {
  const std::string text = DumpJson(ReportJson(FullReport()));
  const JsonValue back = ParseJson(text, "report.json");
  EXPECT_EQ(DumpJson(back), text);  // also with a file name that is not UTF-8
  EXPECT_TRUE(back.At("photos").At("statuses").AsArray()[0].At("why").IsNull());
}

TEST(ReportJson, StagesThatDidNotRunAreAbsent) {
  const JsonValue json = ReportJson(RunReport());
  EXPECT_TRUE(json.At("stages").AsObject().empty());
  EXPECT_EQ(json.Find("photos"), nullptr);
  EXPECT_EQ(json.At("peak_memory_mb_why").AsString(), "not measured");
}

TEST(ReportJson, EvaluationAlone) {
  RunReport report = FullReport();
  EXPECT_EQ(KeysOf(EvaluationJson(report)), (Keys{"schema", "consistency", "fidelity"}));
  report.pairs = {{"styled", 3, 8, 0.001, 30, 0.8, false, 1, 2, 3, 4, 5}};
  const JsonValue json = EvaluationJson(report);
  EXPECT_EQ(KeysOf(json), (Keys{"schema", "consistency", "fidelity", "consistency_pairs"}));
  const JsonValue& pair = json.At("consistency_pairs").AsArray()[0];
  EXPECT_EQ(KeysOf(pair), (Keys{"sequence", "gap", "from", "to", "error", "tc_psnr_db",
                                "coverage", "low_coverage", "flow_not_finite", "out_of_frame",
                                "disoccluded", "motion_boundary", "colour_not_finite"}));
  EXPECT_EQ(pair.At("gap").AsInt(), 5);
}

}  // namespace
}  // namespace regrade
