// Writes the report's structs as JSON, keys in the order of the schema.
#include "pipeline/report/json.h"

#include <string>

namespace regrade {
namespace {

constexpr int kSchema = 1;

using Object = JsonValue::Object;

void Put(Object& object, const std::string& key, const Metric& metric) {
  if (metric.value) {
    object.emplace_back(key, *metric.value);
  } else {
    object.emplace_back(key, nullptr);
    object.emplace_back(key + "_why", metric.why);
  }
}

// Text that may be missing is null rather than empty.
JsonValue TextOrNull(const std::string& text) {
  return text.empty() ? JsonValue() : JsonValue(text);
}

JsonValue Strings(const std::vector<std::string>& strings) {
  return JsonValue::Array(strings.begin(), strings.end());
}

template <typename Rows, typename ToJson>
JsonValue List(const Rows& rows, ToJson&& to_json) {
  JsonValue::Array array;
  for (const auto& row : rows) array.push_back(to_json(row));
  return array;
}

JsonValue CurveJson(const std::vector<std::pair<int64_t, double>>& curve) {
  return List(curve, [](const std::pair<int64_t, double>& at) {
    return JsonValue(JsonValue::Array{at.first, at.second});
  });
}

JsonValue PhotosJson(const PhotosReport& photos) {
  return Object{{"given", photos.given},
                {"used", photos.used},
                {"registered", photos.registered},
                {"statuses", List(photos.statuses, [](const PhotoStatus& photo) {
                   return Object{{"file", photo.file},
                                 {"status", ToString(photo.status)},
                                 {"why", TextOrNull(photo.why)}};
                 })}};
}

JsonValue EffectJson(const EffectReport& effect) {
  Object object{{"name", effect.name}, {"on", effect.on}, {"evidence", effect.evidence}};
  Put(object, "value", effect.value);
  Put(object, "threshold", effect.threshold);
  return object;
}

JsonValue StageJson(const PoseStageReport& stage) {
  Object object{{"seconds", stage.seconds}};
  Put(object, "reprojection_px", stage.reprojection_px);
  object.emplace_back("points", stage.points);
  object.emplace_back("models_found", stage.models_found);
  if (stage.tracks_seconds) {
    object.emplace_back("tracks_seconds", *stage.tracks_seconds);
    object.emplace_back("tracks_cpu_seconds", stage.tracks_cpu_seconds.value_or(0));
  }
  return object;
}

JsonValue StageJson(const ReconstructReport& stage) {
  Object object{{"seconds", stage.seconds}, {"voxels", stage.voxels}};
  Put(object, "psnr_train_db", stage.psnr_train_db);
  Put(object, "psnr_heldout_db", stage.psnr_heldout_db);
  Put(object, "ssim_heldout", stage.ssim_heldout);
  object.emplace_back("heldout", Strings(stage.heldout));
  if (!stage.psnr_at_steps.empty())
    object.emplace_back("psnr_at_steps", CurveJson(stage.psnr_at_steps));
  if (stage.rejected_voxels) object.emplace_back("rejected_voxels", *stage.rejected_voxels);
  return object;
}

JsonValue StageJson(const Style2dReport& stage) {
  Object object{{"seconds", stage.seconds}, {"method", stage.method}};
  if (!stage.notices.empty()) object.emplace_back("notices", Strings(stage.notices));
  return object;
}

JsonValue VarianceJson(const VarianceMetrics& variance) {
  Object object;
  for (const VarianceMetrics::Group& group : variance.groups) {
    Object entry{{"pairs", group.pairs}, {"above", group.above}};
    Put(entry, "gain", group.gain);
    Put(entry, "largest_excess", group.largest_excess);
    object.emplace_back(group.name, std::move(entry));
  }
  Put(object, "largest_share_of_bound", variance.largest_share);
  return object;
}

JsonValue StageJson(const StylizeReport& stage) {
  Object object{{"seconds", stage.seconds}, {"steps", stage.steps}};
  Put(object, "k_est", stage.k_est);
  Put(object, "bound", stage.bound);
  Put(object, "local_lipschitz_sampled", stage.local_lipschitz_sampled);
  Put(object, "psnr_to_2d_db", stage.psnr_to_2d_db);
  Put(object, "psnr_to_2d_photos_db", stage.psnr_to_2d_photos_db);
  Put(object, "linear_map_psnr_to_2d_db", stage.linear_map_psnr_to_2d_db);
  Put(object, "local_lipschitz_max", stage.local_lipschitz_max);
  Put(object, "local_lipschitz_of_map", stage.local_lipschitz_of_map);
  Put(object, "local_lipschitz_along_coefficients", stage.local_lipschitz_along_coefficients);
  Put(object, "local_lipschitz_along_position", stage.local_lipschitz_along_position);
  if (!stage.bound_at_steps.empty())
    object.emplace_back("bound_at_steps", CurveJson(stage.bound_at_steps));
  if (stage.variance) object.emplace_back("variance", VarianceJson(*stage.variance));
  if (!stage.notices.empty()) object.emplace_back("notices", Strings(stage.notices));
  if (stage.rejected_steps) object.emplace_back("rejected_steps", *stage.rejected_steps);
  return object;
}

JsonValue StageJson(const RenderReport& stage) {
  Object object{{"seconds", stage.seconds}, {"frames", stage.frames}};
  Put(object, "frames_per_second", stage.frames_per_second);
  if (stage.film_width > 0)
    object.emplace_back("film",
                        Object{{"width", stage.film_width}, {"height", stage.film_height}});
  return object;
}

JsonValue StageJson(const EvaluateReport& stage) {
  Object object{{"seconds", stage.seconds}, {"flow", stage.flow}, {"mask", stage.mask}};
  if (!stage.comparison_note.empty())
    object.emplace_back("comparison_note", stage.comparison_note);
  return object;
}

JsonValue StagesJson(const RunReport& report) {
  const StagesReport& stages = report.stages;
  Object object;
  const auto add = [&](const char* name, const auto& stage) {
    if (!stage) return;
    JsonValue json = StageJson(*stage);
    for (const auto& [of, seconds] : report.cpu_seconds)
      if (of == name) json["cpu_seconds"] = seconds;
    object.emplace_back(name, std::move(json));
  };
  add("pose", stages.pose);
  add("reconstruct", stages.reconstruct);
  add("style_2d", stages.style_2d);
  add("stylize", stages.stylize);
  add("render", stages.render);
  add("evaluate", stages.evaluate);
  return object;
}

JsonValue ConsistencyJson(const ConsistencyMetrics& row) {
  Object object{{"sequence", row.sequence},
                {"gap", row.gap},
                {"pairs", row.pairs},
                {"undefined_pairs", row.undefined_pairs}};
  Put(object, "tc_psnr_mean_db", row.tc_psnr_mean_db);
  Put(object, "tc_psnr_of_mean_db", row.tc_psnr_of_mean_db);
  Put(object, "tc_psnr_low_db", row.tc_psnr_low_db);
  Put(object, "tc_psnr_high_db", row.tc_psnr_high_db);
  Put(object, "coverage", row.coverage);
  if (!row.heat_map.empty()) {
    object.emplace_back("heat_map", row.heat_map);
    object.emplace_back("heat_map_from", row.heat_map_from);
  }
  if (!row.tc_psnr_pairs_db.empty()) {
    object.emplace_back("tc_psnr_pairs_db", List(row.tc_psnr_pairs_db, [](const Metric& pair) {
                          return pair.value ? JsonValue(*pair.value) : JsonValue();
                        }));
  }
  return object;
}

JsonValue PairJson(const PairMetrics& pair) {
  Object object{{"sequence", pair.sequence},
                {"gap", pair.to - pair.from},
                {"from", pair.from},
                {"to", pair.to}};
  Put(object, "error", pair.error);
  Put(object, "tc_psnr_db", pair.tc_psnr_db);
  object.emplace_back("coverage", pair.coverage);
  object.emplace_back("low_coverage", pair.low_coverage);
  object.emplace_back("flow_not_finite", pair.flow_not_finite);
  object.emplace_back("out_of_frame", pair.out_of_frame);
  object.emplace_back("disoccluded", pair.disoccluded);
  object.emplace_back("motion_boundary", pair.motion_boundary);
  object.emplace_back("colour_not_finite", pair.colour_not_finite);
  return object;
}

JsonValue FidelityJson(const FidelityMetrics& row) {
  Object object{{"sequence", row.sequence}};
  Put(object, "psnr_to_2d_db", row.psnr_to_2d_db);
  if (row.lpips_to_2d) object.emplace_back("lpips_to_2d", *row.lpips_to_2d);
  if (row.structure) object.emplace_back("structure", *row.structure);
  Put(object, "hue_std", row.hue_std);
  Put(object, "hue_std_2d", row.hue_std_2d);
  Put(object, "chroma", row.chroma);
  Put(object, "chroma_2d", row.chroma_2d);
  Put(object, "sliced_wasserstein_to_style", row.sliced_wasserstein_to_style);
  return object;
}

}  // namespace

JsonValue CostJson(const CostRow& cost) {
  Object object{{"benchmark", cost.benchmark}, {"parameter", cost.parameter},
                {"setting", cost.setting},     {"measure", cost.measure},
                {"unit", cost.unit},           {"repeats", cost.repeats}};
  Put(object, "seconds", cost.seconds);
  Put(object, "seconds_spread", cost.seconds_spread);
  Put(object, "cpu_seconds", cost.cpu_seconds);
  Put(object, "cpu_spread", cost.cpu_spread);
  Put(object, "accuracy", cost.accuracy);
  Put(object, "accuracy_spread", cost.accuracy_spread);
  Put(object, "error", cost.error);
  object.emplace_back("on_pareto_front", cost.on_pareto_front);
  object.emplace_back("dominated_by", TextOrNull(cost.dominated_by));
  return object;
}

JsonValue ReportJson(const RunReport& report) {
  Object object{{"schema", kSchema},
                {"regrade", report.version},
                {"command", Strings(report.command)},
                {"preset", report.preset},
                {"device", report.device},
                {"seed", report.seed},
                {"seconds", report.seconds}};
  Put(object, "peak_memory_mb", report.peak_memory_mb);
  if (report.photos) object.emplace_back("photos", PhotosJson(*report.photos));
  object.emplace_back("effects", List(report.effects, EffectJson));
  object.emplace_back("stages", StagesJson(report));
  object.emplace_back("consistency", List(report.consistency, ConsistencyJson));
  object.emplace_back("fidelity", List(report.fidelity, FidelityJson));
  if (!report.pairs.empty())
    object.emplace_back("consistency_pairs", List(report.pairs, PairJson));
  if (!report.versions.empty()) {
    Object versions;
    for (const OptionValue& version : report.versions)
      versions.emplace_back(version.name, version.value);
    object.emplace_back("versions", std::move(versions));
  }
  if (!report.costs.empty()) object.emplace_back("costs", List(report.costs, CostJson));
  return object;
}

JsonValue EvaluationJson(const RunReport& report) {
  Object object{{"schema", kSchema},
                {"consistency", List(report.consistency, ConsistencyJson)},
                {"fidelity", List(report.fidelity, FidelityJson)}};
  if (!report.pairs.empty())
    object.emplace_back("consistency_pairs", List(report.pairs, PairJson));
  return object;
}

}  // namespace regrade
