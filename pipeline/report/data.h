// The contents of a report as plain data: report.json and report.html are both written from it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/report/evaluation_metrics.h"
#include "pipeline/report/photo_spacing.h"
#include "pipeline/report/stage_metrics.h"
#include "pipeline/workspace/metric.h"

namespace regrade {

struct PhotosReport {
  int given = 0;
  int used = 0;
  int registered = 0;
  std::vector<PhotoStatus> statuses;  // one for each given file
};

// Cost and accuracy of one value of a parameter, measured on this machine. Rows of one
// benchmark compare with each other.
struct CostRow {
  std::string benchmark;  // "fit"
  std::string parameter;  // the option, "fit-steps"; empty for the baseline
  std::string setting;    // "300"
  std::string measure;    // what accuracy is: "held-out PSNR"
  std::string unit;       // "dB"
  int repeats = 1;
  // Medians, and half of the range.
  Metric seconds, seconds_spread, cpu_seconds, cpu_spread, accuracy, accuracy_spread;
  Metric error;                  // against the parameter's accurate end; positive is worse
  bool on_pareto_front = false;  // nothing is as accurate in less time
  std::string dominated_by;      // a row that is better beyond the spreads; may be empty
  // Medians, where accuracy is a PSNR to photos.
  std::optional<double> ssim = {}, detail_kept = {}, lpips = {};

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("benchmark", benchmark);
    visit("parameter", parameter);
    visit("setting", setting);
    visit("measure", measure);
    visit("unit", unit);
    visit("repeats", repeats);
    visit("seconds", seconds);
    visit("seconds_spread", seconds_spread);
    visit("cpu_seconds", cpu_seconds);
    visit("cpu_spread", cpu_spread);
    visit("accuracy", accuracy);
    visit("accuracy_spread", accuracy_spread);
    visit("error", error);
    visit("on_pareto_front", on_pareto_front);
    visit("dominated_by", dominated_by, {.optional = true});
    visit("ssim", ssim);
    visit("detail_kept", detail_kept);
    visit("lpips", lpips);
  }
};

// An option in effect, as in run.json.
struct OptionValue {
  std::string name, value;
};

struct RunReport {
  std::string version;               // of regrade
  std::vector<std::string> command;  // argv; pages of other programs' frames do not show it
  std::string preset, device;
  uint64_t seed = 0;
  double seconds = 0;
  Metric peak_memory_mb;
  std::optional<PhotosReport> photos;
  std::optional<PhotoSpacing> spacing;  // for advice
  std::vector<EffectReport> effects;
  StagesReport stages;
  EvaluationMetrics evaluation;
  std::vector<CostRow> costs;
  std::vector<OptionValue> options;   // of run.json; shown on the page only
  std::vector<OptionValue> versions;  // of this program's parts and of programs it starts
};

}  // namespace regrade
