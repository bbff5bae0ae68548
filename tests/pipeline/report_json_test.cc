// report.json: the keys of schema 2 in their order, reasons beside nulls, and metrics read
// back.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "pipeline/report/json.h"
#include "pipeline/report/records.h"
#include "pipeline/workspace/metrics_json.h"
#include "tests/support/expect_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

using Keys = std::vector<std::string>;

Keys KeysOf(const JsonValue& object) {
  Keys keys;
  for (const auto& [key, value] : object.AsObject()) keys.push_back(key);
  return keys;
}

StylizeReport MeasuredStyle() {
  StylizeReport stylize;
  stylize.time = {4, 7.5};
  stylize.device = "cpu";
  stylize.steps = 300;
  stylize.psnr_train_db = 27;
  stylize.k_est = 1.5;
  stylize.bound = 1.9;
  stylize.local_lipschitz_sampled = stylize.local_lipschitz_along_coefficients = 1.2;
  stylize.local_lipschitz_max = 1.3;
  stylize.local_lipschitz_of_map = 1.1;
  stylize.local_lipschitz_along_position = 0.1;
  stylize.bound_at_steps = {{0, 2.5}, {300, 1.9}};
  stylize.notices = {"the style picture is grey"};
  return stylize;
}

EvaluationMetrics MeasuredEvaluation() {
  EvaluationMetrics metrics;
  ConsistencyMetrics row;
  row.sequence = "styled";
  row.pairs = 2;
  row.tc_psnr_mean_db = 29.8;
  row.tc_psnr_of_mean_db = 29.5;
  row.tc_psnr_low_db = 29.1;
  row.tc_psnr_high_db = 30.4;
  row.coverage = 0.8;
  row.tc_psnr_pairs_db = {30.0, Metric()};
  row.heat_map = "heatmaps/a.png";
  row.heat_map_from = 3;
  metrics.consistency = {row};
  metrics.pairs = {{"styled", 3, 8, 0.001, 30, {}, 0.8, false, 1, 2, 3, 4, 5}};
  FidelityRow fidelity;
  fidelity.sequence = "styled";
  fidelity.psnr_to_2d_db = 27;
  fidelity.hue_std = 0.19;
  fidelity.hue_std_2d = 0.2;
  fidelity.chroma = 12;
  fidelity.chroma_2d = 13;
  fidelity.sliced_wasserstein_to_style = 0.01;
  metrics.fidelity = {fidelity};
  return metrics;
}

// A report in which every metric has a value.
RunReport FullReport() {
  RunReport report;
  report.version = "0.1.0";
  report.command = {"regrade", "run"};
  report.seed = std::numeric_limits<uint64_t>::max();
  report.peak_memory_mb = 900;
  report.photos = PhotosReport{
      2, 1, 1, {{"a.jpg", PhotoState::kUsed, ""}, {"\xFF.jpg", PhotoState::kSkipped, "text"}}};
  report.effects = {{"ndc", false, "corner rays", 0.41, 0.9}};
  report.stages.pose = PoseStageReport{
      .time = {1, {}}, .registered = 2, .points = 12775, .reprojection_px = 0.9};
  report.stages.reconstruct = ReconstructReport{.time = {2, 3},
                                                .device = "cpu",
                                                .finest_grid = 64,
                                                .rays = 4096,
                                                .sh_degree = 2,
                                                .voxels = 1000,
                                                .psnr_train_db = 29,
                                                .ssim_train = 0.85,
                                                .detail_kept_train = 0.7,
                                                .detail_error_train = 4,
                                                .psnr_heldout_db = 26.5,
                                                .ssim_heldout = 0.8,
                                                .detail_kept_heldout = 0.6,
                                                .detail_error_heldout = 5,
                                                .sharpness = "slightly soft",
                                                .heldout = {"a.jpg"}};
  report.stages.style_2d = Style2dReport{.time = {3, {}}, .method = "mkl", .views = 7};
  report.stages.stylize = MeasuredStyle();
  report.stages.render = RenderReport{.time = {5, {}},
                                      .device = "cpu",
                                      .frames = 60,
                                      .path_frames = 36,
                                      .film_frames = 180,
                                      .film_seconds = 6,
                                      .path_transmittance = 0.97,
                                      .path_photo_distance = 1.4,
                                      .film = {640, 480},
                                      .strength = 1,
                                      .frames_per_second = 12,
                                      .seen_by_few = {0.41, 0.72, 12, {0.5, 0.25}}};
  report.stages.evaluate =
      EvaluateReport{{6, {}}, "dis-medium", "lai2018", "later", "channel", "", "", 25, 26, 0.2};
  report.evaluation = MeasuredEvaluation();
  return report;
}

TEST(ReportJson, HasTheKeysOfSchema2InOrder) {
  const JsonValue json = ReportJson(FullReport());
  EXPECT_EQ(KeysOf(json), (Keys{"schema", "regrade", "command", "preset", "device", "seed",
                                "seconds", "peak_memory_mb", "photos", "effects", "stages",
                                "consistency", "fidelity", "consistency_pairs"}));
  EXPECT_EQ(json.At("schema").AsInt(), 2);
  EXPECT_EQ(KeysOf(json.At("photos")), (Keys{"given", "used", "registered", "statuses"}));
  EXPECT_EQ(KeysOf(json.At("photos").At("statuses").AsArray()[0]),
            (Keys{"file", "status", "why"}));
  EXPECT_EQ(KeysOf(json.At("effects").AsArray()[0]),
            (Keys{"name", "on", "evidence", "value", "threshold"}));
  const JsonValue& stages = json.At("stages");
  EXPECT_EQ(KeysOf(stages),
            (Keys{"pose", "reconstruct", "style_2d", "stylize", "render", "evaluate"}));
  EXPECT_EQ(KeysOf(stages.At("pose")), (Keys{"seconds", "attempts", "notices", "registered",
                                             "points", "reprojection_px", "models_found"}));
  EXPECT_EQ(
      KeysOf(stages.At("reconstruct")),
      (Keys{"seconds", "device", "finest_grid", "rays", "sh_degree", "voxels", "psnr_train_db",
            "ssim_train", "detail_kept_train", "detail_error_train", "rejected_voxels",
            "psnr_heldout_db", "ssim_heldout", "detail_kept_heldout", "detail_error_heldout",
            "sharpness", "heldout", "psnr_at_steps", "cpu_seconds"}));
  EXPECT_EQ(KeysOf(stages.At("style_2d")), (Keys{"seconds", "method", "views", "notices"}));
  EXPECT_EQ(
      KeysOf(stages.At("stylize")),
      (Keys{"seconds", "device", "steps", "rejected_steps", "psnr_train_db", "bound",
            "local_lipschitz_sampled", "local_lipschitz_max", "k_est", "local_lipschitz_of_map",
            "local_lipschitz_along_coefficients", "local_lipschitz_along_position",
            "bound_at_steps", "notices", "cpu_seconds"}));
  EXPECT_EQ(KeysOf(stages.At("render")),
            (Keys{"seconds", "device", "frames", "path_frames", "film_frames", "film_seconds",
                  "path_transmittance", "path_photo_distance", "film", "strength",
                  "frames_per_second", "seen_by_few"}));
  EXPECT_EQ(KeysOf(stages.At("render").At("seen_by_few")),
            (Keys{"film", "worst_frame", "worst_frame_number", "photos"}));
  EXPECT_EQ(KeysOf(stages.At("evaluate")),
            (Keys{"seconds", "flow", "mask", "warp", "error_per", "psnr_to_2d_photos_db",
                  "linear_map_psnr_to_2d_db", "lpips_heldout"}));
  EXPECT_EQ(KeysOf(json.At("consistency").AsArray()[0]),
            (Keys{"sequence", "gap", "pairs", "undefined_pairs", "tc_psnr_mean_db",
                  "tc_psnr_of_mean_db", "tc_psnr_low_db", "tc_psnr_high_db", "coverage",
                  "tc_psnr_pairs_db", "heat_map", "heat_map_from"}));
  EXPECT_EQ(KeysOf(json.At("consistency_pairs").AsArray()[0]),
            (Keys{"sequence", "gap", "from", "to", "error", "tc_psnr_db", "coverage",
                  "low_coverage", "flow_not_finite", "out_of_frame", "disoccluded",
                  "motion_boundary", "colour_not_finite"}));
  EXPECT_EQ(json.At("consistency_pairs").AsArray()[0].At("gap").AsInt(), 5);
  EXPECT_EQ(KeysOf(json.At("fidelity").AsArray()[0]),
            (Keys{"sequence", "psnr_to_2d_db", "hue_std", "hue_std_2d", "chroma", "chroma_2d",
                  "sliced_wasserstein_to_style"}));
}

TEST(ReportJson, OptionalMetricsAppearWhereTheyWereMeasured) {
  RunReport report = FullReport();
  report.stages.pose->tracks = TracksMetrics{12.5, 20};
  report.stages.pose->colmap = "3.8";
  report.stages.stylize->variance.emplace();
  report.evaluation.fidelity[0].structure = 0.9;
  const JsonValue json = ReportJson(report);
  const JsonValue& pose = json.At("stages").At("pose");
  EXPECT_EQ(pose.At("tracks").At("seconds").AsDouble(), 12.5);
  EXPECT_EQ(pose.At("tracks").At("cpu_seconds").AsDouble(), 20);
  EXPECT_EQ(pose.At("colmap").AsString(), "3.8");
  EXPECT_EQ(KeysOf(json.At("stages").At("stylize").At("variance")),
            (Keys{"valid", "clamped", "transparent", "largest_fraction_of_bound",
                  "largest_fraction_of_bound_why"}));
  EXPECT_EQ(json.At("fidelity").AsArray()[0].At("structure").AsDouble(), 0.9);
}

TEST(ReportJson, UndefinedMetricsAreNullWithAReason) {
  RunReport report = FullReport();
  report.stages.reconstruct->psnr_heldout_db = Metric::Undefined("holdout is 0");
  report.evaluation.consistency[0].tc_psnr_mean_db = std::numeric_limits<double>::quiet_NaN();
  const JsonValue json = ReportJson(report);
  const JsonValue& stage = json.At("stages").At("reconstruct");
  EXPECT_TRUE(stage.At("psnr_heldout_db").IsNull());
  EXPECT_EQ(stage.At("psnr_heldout_db_why").AsString(), "holdout is 0");
  EXPECT_EQ(stage.Find("psnr_train_db_why"), nullptr);
  const JsonValue& row = json.At("consistency").AsArray()[0];
  EXPECT_TRUE(row.At("tc_psnr_mean_db").IsNull());
  EXPECT_FALSE(row.At("tc_psnr_mean_db_why").AsString().empty());
  EXPECT_TRUE(row.At("tc_psnr_pairs_db").AsArray()[1].IsNull());
  EXPECT_EQ(row.At("tc_psnr_pairs_db").AsArray().size(), 2u);
}

TEST(ReportJson, SurvivesARoundTripThroughText) {
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
  RunReport report;
  report.evaluation = MeasuredEvaluation();
  report.stages.evaluate.emplace();
  report.stages.evaluate->mask = "ruder2016";
  const JsonValue json = EvaluationJson(report);
  EXPECT_EQ(KeysOf(json), (Keys{"schema", "regrade", "command", "stages", "consistency",
                                "fidelity", "consistency_pairs"}));
  EXPECT_EQ(KeysOf(json.At("stages")), Keys{"evaluate"});
  EXPECT_EQ(json.At("stages").At("evaluate").At("mask").AsString(), "ruder2016");
}

// What is read is what was written, member for member.
template <typename Metrics>
void ExpectRoundTrip(const Metrics& metrics) {
  const std::string text = DumpJson(MetricsToJson(metrics));
  EXPECT_EQ(DumpJson(MetricsToJson(MetricsFromJson<Metrics>(ParseJson(text, "record")))), text);
}

TEST(MetricsJson, EveryStageSurvivesARoundTrip) {
  RunReport report = FullReport();
  report.stages.pose->tracks = TracksMetrics{12.5, 20};
  report.stages.pose->photo_masks = 3;
  report.stages.reconstruct->background_texels = 5;
  report.stages.reconstruct->psnr_at_steps = {{20, 15.5}, {40, 21.25}};
  report.stages.stylize->variance = VarianceMetrics{{40, 3, 1.2, 0.01}, {}, {}, 0.7};
  report.stages.stylize->variance_across_views =
      VarianceMetrics{{}, {}, {30, 2, 0.9, 0.02}, 0.6, VarianceGroupMetrics{5, 1, 1.1, 0.03}};
  report.stages.evaluate->comparison_note = "one camera";
  report.stages.ForEach([](const char*, const auto& stage) { ExpectRoundTrip(*stage); });
  ExpectRoundTrip(report.evaluation);
  ExpectRoundTrip(report.effects);
  CostRow cost;
  cost.parameter = "fit-steps";
  cost.dominated_by = "fit-rays 512";
  ExpectRoundTrip(std::vector<CostRow>{cost, {}});
}

TEST(MetricsJson, AMissingNumberIsNoZero) {
  const auto read = [](const std::string& text) {
    return MetricsFromJson<RenderReport>(ParseJson(text, "render.json"));
  };
  const std::string whole =
      R"({"device": "cpu", "frames": 3, "path_frames": 0, "film_frames": 2, "film_seconds": 1, )"
      R"("path_transmittance": 1, "path_photo_distance": 1, "strength": 1, "film": {"width": 4, "height": 3},)"
      R"( "seen_by_few": {"film": 0.41, "worst_frame": 0.72, "worst_frame_number": 3, "photos": []},)"
      R"( "frames_per_second": null, "frames_per_second_why": "not measured"})";
  EXPECT_EQ(read(whole).frames_per_second.why, "not measured");
  const auto without = [&](const std::string& part, const std::string& instead = "") {
    std::string text = whole;
    return text.replace(text.find(part), part.size(), instead);
  };
  EXPECT_REGRADE_ERROR(read(without(R"("frames": 3, )")), ExitCode::kInput,
                       "\"frames\" is missing");
  EXPECT_REGRADE_ERROR(read(without("3, \"path", "\"three\", \"path")), ExitCode::kInput,
                       "\"frames\"");
  EXPECT_REGRADE_ERROR(read(without("4, ", "5000000000, ")), ExitCode::kInput, "\"width\"");
  EXPECT_REGRADE_ERROR(read(without(R"(, "frames_per_second_why": "not measured")")),
                       ExitCode::kInput, "null with a reason in \"frames_per_second_why\"");
}

TEST(ReportFromRecords, ReadsWhatStagesRecordAndNamesFileAndKeyOfWhatIsMissing) {
  const testing::TemporaryFolder folder;
  Workspace workspace(folder / "out");
  JsonValue metrics = JsonValue::Object();
  RenderReport render;
  render.frames = 48;
  PutMetrics(render, &metrics);
  workspace.Record("render", JsonValue::Object(), {}, 5, metrics, 9);
  const RunReport report = ReportFromRecords(workspace, workspace);
  EXPECT_EQ(report.stages.render->frames, 48);
  EXPECT_EQ(report.stages.render->time.seconds, 5);
  EXPECT_EQ(report.stages.render->time.cpu_seconds, 9);
  EXPECT_FALSE(report.stages.pose.has_value());

  workspace.Record("render", JsonValue::Object(), {}, 5, JsonValue::Object{{"device", "cpu"}});
  EXPECT_REGRADE_ERROR(ReportFromRecords(workspace, workspace), ExitCode::kInput,
                       "\"frames\" is missing");
  EXPECT_REGRADE_ERROR(ReportFromRecords(workspace, workspace), ExitCode::kInput,
                       ".regrade/stages/render.json");
}

}  // namespace
}  // namespace regrade
