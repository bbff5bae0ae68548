#include "pipeline/report/records.h"

#include <algorithm>

#include "pipeline/workspace/stage_runner.h"

namespace regrade {
namespace {

JsonValue Number(const std::optional<double>& value) {
  return value ? JsonValue(*value) : JsonValue();
}

// A figure and, under "<key>_why", the reason why there is none.
Metric MetricOf(const JsonValue& metrics, const std::string& key) {
  const JsonValue* value = metrics.Find(key);
  if (value != nullptr && value->IsNumber()) return value->AsDouble();
  const JsonValue* why = metrics.Find(key + "_why");
  return Metric::Undefined(why != nullptr && why->IsString() ? why->AsString()
                                                             : "not measured");
}

int64_t CountOf(const JsonValue& metrics, const std::string& key) {
  const JsonValue* value = metrics.Find(key);
  return value != nullptr && value->IsNumber() ? value->AsInt() : 0;
}

std::string TextOf(const JsonValue& metrics, const std::string& key) {
  const JsonValue* value = metrics.Find(key);
  return value != nullptr && value->IsString() ? value->AsString() : "";
}

std::vector<std::string> TextsOf(const JsonValue& metrics, const std::string& key) {
  std::vector<std::string> texts;
  if (const JsonValue* list = metrics.Find(key))
    for (const JsonValue& text : list->AsArray()) texts.push_back(text.AsString());
  return texts;
}

// Infinite figures are no JSON numbers: their reason stands beside them.
void Put(JsonValue* row, const std::string& key, const std::optional<double>& value,
         const std::string& why) {
  const bool finite = value && std::isfinite(*value);
  (*row)[key] = finite ? JsonValue(*value) : JsonValue();
  if (!finite)
    (*row)[key + "_why"] = !why.empty() ? why
                           : value      ? "infinite: no error at all"
                                        : "not defined";
}

ConsistencyMetrics ConsistencyOf(const JsonValue& row) {
  ConsistencyMetrics metrics;
  metrics.sequence = row.At("sequence").AsString();
  metrics.gap = static_cast<int>(row.At("gap").AsInt());
  metrics.pairs = static_cast<int>(row.At("pairs").AsInt());
  metrics.undefined_pairs = static_cast<int>(row.At("undefined_pairs").AsInt());
  metrics.tc_psnr_mean_db = MetricOf(row, "tc_psnr_mean_db");
  metrics.tc_psnr_of_mean_db = MetricOf(row, "tc_psnr_of_mean_db");
  metrics.coverage = MetricOf(row, "coverage");
  metrics.tc_psnr_low_db = MetricOf(row, "tc_psnr_low_db");
  metrics.tc_psnr_high_db = MetricOf(row, "tc_psnr_high_db");
  metrics.heat_map = TextOf(row, "heat_map");
  metrics.heat_map_from = static_cast<int>(CountOf(row, "heat_map_from"));
  for (const JsonValue& pair : row.At("tc_psnr_pairs_db").AsArray())
    metrics.tc_psnr_pairs_db.push_back(pair.IsNumber() ? Metric(pair.AsDouble())
                                                       : Metric::Undefined("not defined"));
  return metrics;
}

PairMetrics PairOf(const JsonValue& row) {
  PairMetrics pair;
  pair.sequence = row.At("sequence").AsString();
  pair.from = static_cast<int>(row.At("from").AsInt());
  pair.to = static_cast<int>(row.At("to").AsInt());
  pair.error = MetricOf(row, "error");
  pair.tc_psnr_db = MetricOf(row, "tc_psnr_db");
  pair.coverage = row.At("coverage").AsDouble();
  pair.low_coverage = row.At("low_coverage").AsBool();
  pair.flow_not_finite = CountOf(row, "flow_not_finite");
  pair.out_of_frame = CountOf(row, "out_of_frame");
  pair.disoccluded = CountOf(row, "disoccluded");
  pair.motion_boundary = CountOf(row, "motion_boundary");
  pair.colour_not_finite = CountOf(row, "colour_not_finite");
  return pair;
}

JsonValue RecordOf(const PairResult& pair) {
  JsonValue row = JsonValue::Object{{"sequence", pair.sequence},
                                    {"from", pair.from},
                                    {"to", pair.to},
                                    {"coverage", pair.coverage},
                                    {"low_coverage", pair.low_coverage},
                                    {"flow_not_finite", pair.flow_not_finite},
                                    {"out_of_frame", pair.out_of_frame},
                                    {"disoccluded", pair.disoccluded},
                                    {"motion_boundary", pair.motion_boundary},
                                    {"colour_not_finite", pair.colour_not_finite}};
  const std::string why = pair.error ? "" : "no pixel can be compared";
  Put(&row, "error", pair.error, why);
  Put(&row, "tc_psnr_db", pair.psnr_db, why);
  return row;
}

FidelityMetrics FidelityOf(const JsonValue& row) {
  FidelityMetrics metrics;
  metrics.sequence = row.At("sequence").AsString();
  metrics.psnr_to_2d_db = MetricOf(row, "psnr_to_2d_db");
  if (const JsonValue* lpips = row.Find("lpips_to_2d")) metrics.lpips_to_2d = lpips->AsDouble();
  if (const JsonValue* s = row.Find("structure")) metrics.structure = s->AsDouble();
  metrics.hue_std = MetricOf(row, "hue_std");
  metrics.hue_std_2d = MetricOf(row, "hue_std_2d");
  metrics.chroma = MetricOf(row, "chroma");
  metrics.chroma_2d = MetricOf(row, "chroma_2d");
  metrics.sliced_wasserstein_to_style = MetricOf(row, "sliced_wasserstein_to_style");
  return metrics;
}

VarianceMetrics VarianceOf(const JsonValue& record) {
  VarianceMetrics variance;
  for (const char* name : {"inside", "clamp", "open"}) {
    const JsonValue* group = record.Find(name);
    if (group == nullptr) continue;
    variance.groups.push_back({name, CountOf(*group, "pairs"), CountOf(*group, "above"),
                               MetricOf(*group, "gain"), MetricOf(*group, "largest_excess")});
  }
  variance.largest_share = MetricOf(record, "largest_share");
  return variance;
}

// Two arrays of a record, steps and what was measured at them.
std::vector<std::pair<int64_t, double>> CurveOf(const JsonValue& metrics, const char* at,
                                                const char* of) {
  std::vector<std::pair<int64_t, double>> curve;
  const JsonValue *steps = metrics.Find(at), *values = metrics.Find(of);
  if (steps == nullptr || values == nullptr) return curve;
  const size_t points = std::min(steps->AsArray().size(), values->AsArray().size());
  for (size_t i = 0; i < points; ++i)
    if (values->AsArray()[i].IsNumber())
      curve.emplace_back(steps->AsArray()[i].AsInt(), values->AsArray()[i].AsDouble());
  return curve;
}

}  // namespace

JsonValue EvaluationRecord(const ConsistencyReport& consistency,
                           const std::vector<FidelityRow>& fidelity,
                           const std::vector<HeatMapFile>& heat_maps) {
  JsonValue::Array rows, pair_rows, fidelity_rows;
  for (const ConsistencyRow& row : consistency.rows) {
    JsonValue::Array pairs;
    for (const PairResult& pair : consistency.pairs)
      if (pair.sequence == row.sequence && pair.to - pair.from == row.gap)
        pairs.push_back(Number(pair.psnr_db));  // infinite ones become null
    JsonValue entry = JsonValue::Object{{"sequence", row.sequence},
                                        {"gap", row.gap},
                                        {"pairs", row.pairs},
                                        {"undefined_pairs", row.undefined_pairs}};
    Put(&entry, "tc_psnr_mean_db", row.tc_psnr_mean_db, row.why);
    Put(&entry, "tc_psnr_of_mean_db", row.tc_psnr_of_mean_db, row.why);
    const std::optional<Interval>& interval = row.tc_psnr_interval_db;
    const std::string few = !row.why.empty() ? row.why : "too few pairs for an interval";
    Put(&entry, "tc_psnr_low_db", interval ? std::optional(interval->low) : std::nullopt, few);
    Put(&entry, "tc_psnr_high_db", interval ? std::optional(interval->high) : std::nullopt,
        few);
    entry["coverage"] = row.coverage;
    entry["tc_psnr_pairs_db"] = std::move(pairs);
    for (const HeatMapFile& map : heat_maps) {
      if (map.sequence != row.sequence || map.gap != row.gap) continue;
      entry["heat_map"] = map.path;
      entry["heat_map_from"] = map.from;
    }
    rows.push_back(std::move(entry));
  }
  for (const FidelityRow& row : fidelity) {
    JsonValue entry = JsonValue::Object{{"sequence", row.sequence}};
    Put(&entry, "psnr_to_2d_db", row.psnr_to_2d_db, "");
    if (row.lpips_to_2d) entry["lpips_to_2d"] = *row.lpips_to_2d;
    if (row.structure) entry["structure"] = *row.structure;
    Put(&entry, "hue_std", row.hue_std, "");
    Put(&entry, "hue_std_2d", row.hue_std_2d, "");
    Put(&entry, "chroma", row.chroma, "");
    Put(&entry, "chroma_2d", row.chroma_2d, "");
    Put(&entry, "sliced_wasserstein_to_style", row.sliced_wasserstein_to_style, "");
    fidelity_rows.push_back(std::move(entry));
  }
  for (const PairResult& pair : consistency.pairs) pair_rows.push_back(RecordOf(pair));
  return JsonValue::Object{{"consistency", std::move(rows)},
                           {"consistency_pairs", std::move(pair_rows)},
                           {"fidelity", std::move(fidelity_rows)}};
}

RunReport ReportOfEvaluation(const JsonValue& metrics) {
  RunReport report;
  for (const JsonValue& row : metrics.At("consistency").AsArray())
    report.consistency.push_back(ConsistencyOf(row));
  if (const JsonValue* pairs = metrics.Find("consistency_pairs"))
    for (const JsonValue& pair : pairs->AsArray()) report.pairs.push_back(PairOf(pair));
  for (const JsonValue& row : metrics.At("fidelity").AsArray())
    report.fidelity.push_back(FidelityOf(row));
  return report;
}

RunReport ReportFromRecords(const Workspace& workspace) {
  const auto evaluate = workspace.Find("evaluate");
  RunReport report = evaluate ? ReportOfEvaluation(evaluate->metrics) : RunReport();
  StagesReport& stages = report.stages;
  const auto pose = workspace.Find("pose"), reconstruct = workspace.Find("reconstruct"),
             style_2d = workspace.Find("style_2d"), stylize = workspace.Find("stylize"),
             render = workspace.Find("render");
  if (pose) {
    const JsonValue& f = pose->metrics;
    stages.pose = {pose->seconds, MetricOf(f, "reprojection_px"), CountOf(f, "points"),
                   static_cast<int>(CountOf(f, "models_found"))};
    if (const JsonValue* tracks = f.Find("tracks"); tracks && tracks->Find("seconds")) {
      stages.pose->tracks_seconds = tracks->At("seconds").AsDouble();
      stages.pose->tracks_cpu_seconds = tracks->At("cpu_seconds").AsDouble();
    }
  }
  if (reconstruct) {
    const JsonValue& f = reconstruct->metrics;
    stages.reconstruct = {reconstruct->seconds,         CountOf(f, "voxels"),
                          MetricOf(f, "psnr_train_db"), MetricOf(f, "psnr_heldout_db"),
                          MetricOf(f, "ssim_heldout"),  {}};
    stages.reconstruct->heldout = TextsOf(f, "heldout");
    stages.reconstruct->psnr_at_steps = CurveOf(f, "curve_steps", "curve_psnr_db");
    if (f.Find("rejected_voxels"))
      stages.reconstruct->rejected_voxels = CountOf(f, "rejected_voxels");
  }
  if (style_2d)
    stages.style_2d = {style_2d->seconds, TextOf(style_2d->metrics, "method"),
                       TextsOf(style_2d->metrics, "notices")};
  if (stylize) {
    const JsonValue& f = stylize->metrics;
    stages.stylize.emplace();
    stages.stylize->seconds = stylize->seconds;
    stages.stylize->steps = static_cast<int>(CountOf(f, "steps"));
    if (f.Find("rejected_steps")) stages.stylize->rejected_steps = CountOf(f, "rejected_steps");
    stages.stylize->k_est = MetricOf(f, "k_est");
    stages.stylize->bound = MetricOf(f, "bound");
    stages.stylize->local_lipschitz_sampled = MetricOf(f, "local_lipschitz_sampled");
    stages.stylize->local_lipschitz_max = MetricOf(f, "local_lipschitz_max");
    stages.stylize->local_lipschitz_of_map = MetricOf(f, "local_lipschitz_of_map");
    stages.stylize->local_lipschitz_along_coefficients =
        MetricOf(f, "local_lipschitz_along_coefficients");
    stages.stylize->local_lipschitz_along_position =
        MetricOf(f, "local_lipschitz_along_position");
    stages.stylize->bound_at_steps = CurveOf(f, "bound_steps", "bound_at_steps");
    stages.stylize->notices = TextsOf(f, "notices");
    if (const JsonValue* variance = f.Find("variance"))
      stages.stylize->variance = VarianceOf(*variance);
  }
  if (render)
    stages.render = {render->seconds, static_cast<int>(CountOf(render->metrics, "frames")),
                     MetricOf(render->metrics, "frames_per_second"),
                     static_cast<int>(CountOf(render->metrics, "film_width")),
                     static_cast<int>(CountOf(render->metrics, "film_height"))};
  if (evaluate) {
    const JsonValue& f = evaluate->metrics;
    stages.evaluate = {evaluate->seconds, TextOf(f, "flow"), TextOf(f, "mask"),
                       TextOf(f, "comparison_note")};
    if (stages.stylize) {
      stages.stylize->psnr_to_2d_photos_db = MetricOf(f, "psnr_to_2d_photos_db");
      stages.stylize->linear_map_psnr_to_2d_db = MetricOf(f, "linear_map_psnr_to_2d_db");
      for (const FidelityMetrics& row : report.fidelity)
        if (row.sequence == "styled") stages.stylize->psnr_to_2d_db = row.psnr_to_2d_db;
    }
  }
  for (const char* name : kStageNames)
    if (const auto record = workspace.Find(name); record && record->cpu_seconds)
      report.cpu_seconds.emplace_back(name, *record->cpu_seconds);
  return report;
}

}  // namespace regrade
