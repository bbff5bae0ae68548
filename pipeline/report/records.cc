#include "pipeline/report/records.h"

#include <limits>
#include <optional>

#include "pipeline/workspace/metrics_json.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {
namespace {

ConsistencyMetrics MetricsOfRow(const ConsistencyRow& row,
                                const std::vector<PairResult>& pairs) {
  ConsistencyMetrics metrics;
  metrics.sequence = row.sequence;
  metrics.gap = row.gap;
  metrics.pairs = row.pairs;
  metrics.undefined_pairs = row.undefined_pairs;
  std::optional<double> mean = row.tc_psnr_mean_db;
  if (!mean && row.perfect_pairs > 0) mean = std::numeric_limits<double>::infinity();
  metrics.tc_psnr_mean_db = Metric(mean, row.why);
  metrics.tc_psnr_of_mean_db = Metric(row.tc_psnr_of_mean_db, row.why);
  metrics.tc_psnr_low_db = metrics.tc_psnr_high_db =
      Metric::Undefined(row.why.empty() ? "too few pairs for an interval" : row.why);
  if (row.tc_psnr_interval_db) {
    metrics.tc_psnr_low_db = row.tc_psnr_interval_db->low;
    metrics.tc_psnr_high_db = row.tc_psnr_interval_db->high;
  }
  metrics.tc_psnr_unmasked_mean_db = row.tc_psnr_unmasked_mean_db;
  if (row.difference) {
    metrics.difference_pairs = row.difference->pairs;
    metrics.tc_psnr_difference_db = row.difference->mean;
    if (const auto& interval = row.difference->interval) {
      metrics.tc_psnr_difference_low_db = interval->low;
      metrics.tc_psnr_difference_high_db = interval->high;
    }
  }
  metrics.coverage = row.coverage;
  for (const PairResult& pair : pairs)
    if (pair.sequence == row.sequence && pair.to - pair.from == row.gap)
      metrics.tc_psnr_pairs_db.push_back(Metric(pair.psnr_db));
  return metrics;
}

WarpedMetrics MetricsOfWarped(const WarpedRow& row, const std::vector<WarpedPair>& pairs) {
  WarpedMetrics metrics;
  metrics.sequence = row.sequence;
  metrics.gap = row.gap;
  metrics.pairs = row.pairs;
  metrics.rmse_published = Metric(row.published.rmse, row.why);
  metrics.rmse = Metric(row.corrected.rmse, row.why);
  metrics.lpips_published = row.published.lpips;
  metrics.lpips = row.corrected.lpips;
  if (row.difference) {
    metrics.difference_pairs = row.difference->pairs;
    metrics.rmse_difference = row.difference->mean;
    if (const auto& interval = row.difference->interval) {
      metrics.rmse_difference_low = interval->low;
      metrics.rmse_difference_high = interval->high;
    }
  }
  metrics.coverage = row.corrected.coverage;
  for (const WarpedPair& pair : pairs) {
    if (pair.sequence != row.sequence || pair.to - pair.from != row.gap) continue;
    metrics.rmse_pairs_published.push_back(Metric(pair.published.rmse));
    metrics.rmse_pairs.push_back(Metric(pair.corrected.rmse));
  }
  return metrics;
}

template <typename Metrics>
Metrics ReadMetrics(const Workspace& workspace, const char* stage, const JsonValue& metrics) {
  try {
    return MetricsFromJson<Metrics>(metrics);
  } catch (const Error& error) {
    throw InputError(error.what_failed(),
                     error.where().empty() ? workspace.StagePath(stage) : error.where(),
                     "delete this file: its stage will be done again");
  }
}

}  // namespace

EvaluationMetrics MetricsOf(const ConsistencyReport& consistency,
                            const std::vector<FidelityRow>& fidelity,
                            const std::vector<HeatMapFile>& heat_maps) {
  EvaluationMetrics metrics;
  for (const ConsistencyRow& row : consistency.rows) {
    metrics.consistency.push_back(MetricsOfRow(row, consistency.pairs));
    for (const HeatMapFile& map : heat_maps) {
      if (map.sequence != row.sequence || map.gap != row.gap) continue;
      metrics.consistency.back().heat_map = map.path;
      metrics.consistency.back().heat_map_from = map.from;
    }
  }
  metrics.fidelity = fidelity;
  metrics.pairs = consistency.pairs;
  if (!consistency.warped.empty()) metrics.warped.emplace();
  for (const WarpedRow& row : consistency.warped)
    metrics.warped->push_back(MetricsOfWarped(row, consistency.warped_pairs));
  return metrics;
}

RunReport ReportFromRecords(const Workspace& scene, const Workspace& style) {
  RunReport report;
  report.stages.ForEach([&](const char* name, auto& stage) {
    const Workspace& workspace = IsOfScene(name) ? scene : style;
    const auto record = workspace.Find(name);
    if (!record) return;
    using Metrics = typename std::remove_reference_t<decltype(stage)>::value_type;
    stage = ReadMetrics<Metrics>(workspace, name, record->metrics);
    stage->time = {record->seconds, record->cpu_seconds};
    if constexpr (std::is_same_v<Metrics, EvaluateReport>)
      report.evaluation = ReadMetrics<EvaluationMetrics>(workspace, name, record->metrics);
  });
  return report;
}

}  // namespace regrade
