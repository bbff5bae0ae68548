#include "pipeline/report_records.h"

namespace regrade {
namespace {

JsonValue Number(const std::optional<double>& value) {
  return value ? JsonValue(*value) : JsonValue();
}

// A figure and, under "<key>_why", the reason why there is none.
Figure FigureOf(const JsonValue& figures, const std::string& key) {
  const JsonValue* value = figures.Find(key);
  if (value != nullptr && value->IsNumber()) return value->AsDouble();
  const JsonValue* why = figures.Find(key + "_why");
  return Figure::Undefined(why != nullptr && why->IsString() ? why->AsString()
                                                             : "not measured");
}

int64_t CountOf(const JsonValue& figures, const std::string& key) {
  const JsonValue* value = figures.Find(key);
  return value != nullptr && value->IsNumber() ? value->AsInt() : 0;
}

std::string TextOf(const JsonValue& figures, const std::string& key) {
  const JsonValue* value = figures.Find(key);
  return value != nullptr && value->IsString() ? value->AsString() : "";
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

ConsistencyFigures ConsistencyOf(const JsonValue& row) {
  ConsistencyFigures figures;
  figures.sequence = row.At("sequence").AsString();
  figures.gap = static_cast<int>(row.At("gap").AsInt());
  figures.pairs = static_cast<int>(row.At("pairs").AsInt());
  figures.undefined_pairs = static_cast<int>(row.At("undefined_pairs").AsInt());
  figures.tc_psnr_mean_db = FigureOf(row, "tc_psnr_mean_db");
  figures.tc_psnr_of_mean_db = FigureOf(row, "tc_psnr_of_mean_db");
  figures.coverage = FigureOf(row, "coverage");
  for (const JsonValue& pair : row.At("tc_psnr_pairs_db").AsArray())
    figures.tc_psnr_pairs_db.push_back(pair.IsNumber() ? Figure(pair.AsDouble())
                                                       : Figure::Undefined("not defined"));
  return figures;
}

FidelityFigures FidelityOf(const JsonValue& row) {
  FidelityFigures figures;
  figures.sequence = row.At("sequence").AsString();
  figures.psnr_to_2d_db = FigureOf(row, "psnr_to_2d_db");
  figures.hue_std = FigureOf(row, "hue_std");
  figures.hue_std_2d = FigureOf(row, "hue_std_2d");
  figures.chroma = FigureOf(row, "chroma");
  figures.chroma_2d = FigureOf(row, "chroma_2d");
  figures.sliced_wasserstein_to_style = FigureOf(row, "sliced_wasserstein_to_style");
  return figures;
}

}  // namespace

JsonValue EvaluationRecord(const ConsistencyReport& consistency,
                           const std::vector<FidelityRow>& fidelity) {
  JsonValue::Array rows, fidelity_rows;
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
    entry["coverage"] = row.coverage;
    entry["tc_psnr_pairs_db"] = std::move(pairs);
    rows.push_back(std::move(entry));
  }
  for (const FidelityRow& row : fidelity) {
    JsonValue entry = JsonValue::Object{{"sequence", row.sequence}};
    Put(&entry, "psnr_to_2d_db", row.psnr_to_2d_db, "");
    Put(&entry, "hue_std", row.hue_std, "");
    Put(&entry, "hue_std_2d", row.hue_std_2d, "");
    Put(&entry, "chroma", row.chroma, "");
    Put(&entry, "chroma_2d", row.chroma_2d, "");
    Put(&entry, "sliced_wasserstein_to_style", row.sliced_wasserstein_to_style, "");
    fidelity_rows.push_back(std::move(entry));
  }
  return JsonValue::Object{{"consistency", std::move(rows)},
                           {"fidelity", std::move(fidelity_rows)}};
}

RunReport ReportOfEvaluation(const JsonValue& figures) {
  RunReport report;
  for (const JsonValue& row : figures.At("consistency").AsArray())
    report.consistency.push_back(ConsistencyOf(row));
  for (const JsonValue& row : figures.At("fidelity").AsArray())
    report.fidelity.push_back(FidelityOf(row));
  return report;
}

RunReport ReportFromRecords(const Workspace& workspace) {
  const auto evaluate = workspace.Find("evaluate");
  RunReport report = evaluate ? ReportOfEvaluation(evaluate->figures) : RunReport();
  StagesReport& stages = report.stages;
  const auto pose = workspace.Find("pose"), reconstruct = workspace.Find("reconstruct"),
             style_2d = workspace.Find("style_2d"), stylize = workspace.Find("stylize"),
             render = workspace.Find("render");
  if (pose) {
    const JsonValue& f = pose->figures;
    stages.pose = {pose->seconds, FigureOf(f, "reprojection_px"), CountOf(f, "points"),
                   static_cast<int>(CountOf(f, "models_found"))};
  }
  if (reconstruct) {
    const JsonValue& f = reconstruct->figures;
    stages.reconstruct = {reconstruct->seconds,         CountOf(f, "voxels"),
                          FigureOf(f, "psnr_train_db"), FigureOf(f, "psnr_heldout_db"),
                          FigureOf(f, "ssim_heldout"),  {}};
    if (const JsonValue* files = f.Find("heldout"))
      for (const JsonValue& file : files->AsArray())
        stages.reconstruct->heldout.push_back(file.AsString());
  }
  if (style_2d) stages.style_2d = {style_2d->seconds, TextOf(style_2d->figures, "method")};
  if (stylize) {
    const JsonValue& f = stylize->figures;
    stages.stylize.emplace();
    stages.stylize->seconds = stylize->seconds;
    stages.stylize->steps = static_cast<int>(CountOf(f, "steps"));
    stages.stylize->k_est = FigureOf(f, "k_est");
    stages.stylize->bound = FigureOf(f, "bound");
    stages.stylize->slope_observed = FigureOf(f, "slope_observed");
  }
  if (render)
    stages.render = {render->seconds, static_cast<int>(CountOf(render->figures, "frames")),
                     FigureOf(render->figures, "frames_per_second")};
  if (evaluate) {
    const JsonValue& f = evaluate->figures;
    stages.evaluate = {evaluate->seconds, TextOf(f, "flow"), TextOf(f, "mask")};
    if (stages.stylize) {
      stages.stylize->psnr_to_2d_photos_db = FigureOf(f, "psnr_to_2d_photos_db");
      stages.stylize->linear_map_psnr_to_2d_db = FigureOf(f, "linear_map_psnr_to_2d_db");
      for (const FidelityFigures& row : report.fidelity)
        if (row.sequence == "styled") stages.stylize->psnr_to_2d_db = row.psnr_to_2d_db;
    }
  }
  return report;
}

}  // namespace regrade
