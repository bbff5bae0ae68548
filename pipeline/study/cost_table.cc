#include "pipeline/study/cost_table.h"

#include <algorithm>
#include <cstdio>
#include <utility>

#include "pipeline/report/cost_rows.h"
#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

// Median, and half of the range.
struct Spread {
  double median = 0, spread = 0;
};

Spread Of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {median, 0.5 * (values.back() - values.front())};
}

// Larger is better, for every benchmark.
double Merit(const CostRow& row) {
  return BenchmarkOf(row.benchmark).more_is_better ? *row.accuracy.value : -*row.accuracy.value;
}

bool AtLeastAsGood(const CostRow& a, const CostRow& b) {
  return Merit(a) >= Merit(b) && *a.cpu_seconds.value <= *b.cpu_seconds.value;
}

bool Beats(const CostRow& a, const CostRow& b) {
  return AtLeastAsGood(a, b) && !AtLeastAsGood(b, a);
}

bool BeatsBeyondNoise(const CostRow& a, const CostRow& b) {
  if (!Beats(a, b) || a.repeats < 2 || b.repeats < 2) return false;
  return *b.cpu_seconds.value - *a.cpu_seconds.value >
             *a.cpu_spread.value + *b.cpu_spread.value ||
         Merit(a) - Merit(b) > *a.accuracy_spread.value + *b.accuracy_spread.value;
}

// Relative to the accurate end of the same parameter, which may be the base.
void FillErrors(const std::vector<Variant>& variants, std::vector<CostRow>* rows) {
  for (CostRow& row : *rows) {
    if (row.parameter.empty() || row.parameter == "preset") continue;
    const auto end = std::find_if(variants.begin(), variants.end(), [&](const Variant& v) {
      return v.benchmark == row.benchmark && v.parameter == row.parameter && v.accurate_end;
    });
    const std::string parameter = end == variants.end() ? "" : end->parameter;
    const std::string value = end == variants.end() ? "" : end->value;
    for (const CostRow& other : *rows)
      if (other.benchmark == row.benchmark && other.parameter == parameter &&
          (parameter.empty() || other.setting == value))
        row.error = Merit(other) - Merit(row);
  }
}

void MarkParetoFront(std::vector<CostRow>* rows) {
  for (CostRow& row : *rows) {
    row.on_pareto_front = true;
    for (const CostRow& other : *rows) {
      if (other.benchmark != row.benchmark || &other == &row) continue;
      if (Beats(other, row)) row.on_pareto_front = false;
      if (row.dominated_by.empty() && BeatsBeyondNoise(other, row))
        row.dominated_by = NameOf(other);
    }
  }
}

std::string Cell(const Metric& metric, int decimals) {
  return metric.value ? FixedNumber(*metric.value, decimals) : "-";
}

// Enough digits for milliseconds and for hours.
int DecimalsFor(const Metric& seconds) { return seconds.value && *seconds.value < 1 ? 4 : 2; }

std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace

std::vector<CostRow> CostTable(const std::vector<Variant>& variants,
                               const std::vector<Measurement>& measurements,
                               const std::string& base) {
  std::vector<CostRow> rows;
  for (const Variant& variant : variants) {
    std::vector<double> seconds, cpu, accuracy, ssim, detail_kept, lpips;
    for (const Measurement& m : measurements) {
      if (m.benchmark != variant.benchmark || m.parameter != variant.parameter ||
          m.value != variant.value)
        continue;
      seconds.push_back(m.seconds);
      cpu.push_back(m.cpu_seconds);
      accuracy.push_back(m.accuracy);
      if (m.ssim) ssim.push_back(*m.ssim);
      if (m.detail_kept) detail_kept.push_back(*m.detail_kept);
      if (m.lpips) lpips.push_back(*m.lpips);
    }
    if (seconds.empty()) continue;
    const Benchmark& benchmark = BenchmarkOf(variant.benchmark);
    CostRow row;
    row.benchmark = variant.benchmark;
    row.parameter = variant.parameter;
    row.setting = variant.parameter.empty() ? base : variant.value;
    row.measure = benchmark.accuracy;
    row.unit = benchmark.unit;
    row.repeats = static_cast<int>(seconds.size());
    row.seconds = Of(seconds).median;
    row.seconds_spread = Of(seconds).spread;
    row.cpu_seconds = Of(cpu).median;
    row.cpu_spread = Of(cpu).spread;
    row.accuracy = Of(accuracy).median;
    row.accuracy_spread = Of(accuracy).spread;
    if (!ssim.empty()) row.ssim = Of(ssim).median;
    if (!detail_kept.empty()) row.detail_kept = Of(detail_kept).median;
    if (!lpips.empty()) row.lpips = Of(lpips).median;
    row.error = Metric::Undefined("not a value of a single parameter");
    rows.push_back(std::move(row));
  }
  // Presets are measured last: groups them with the other rows of their benchmark.
  std::stable_sort(rows.begin(), rows.end(), [](const CostRow& a, const CostRow& b) {
    return &BenchmarkOf(a.benchmark) < &BenchmarkOf(b.benchmark);
  });
  FillErrors(variants, &rows);
  MarkParetoFront(&rows);
  return rows;
}

std::string CostTableText(const std::vector<CostRow>& rows) {
  std::string text, benchmark;
  char line[256];
  for (const CostRow& row : rows) {
    if (row.benchmark != benchmark) {
      benchmark = row.benchmark;
      text += (text.empty() ? "" : "\n") + benchmark + ": " + row.measure + ", " + row.unit +
              "; time of " + BenchmarkOf(benchmark).time_of + "; * on the Pareto front\n";
      std::snprintf(line, sizeof line, "  %-40s %10s %10s %9s %10s %9s %9s\n", "", "s", "CPU s",
                    "+-", row.unit.c_str(), "+-", "error");
      text += line;
    }
    const int decimals = DecimalsFor(row.cpu_seconds);
    std::snprintf(line, sizeof line, "%s %-40s %10s %10s %9s %10s %9s %9s",
                  row.on_pareto_front ? "*" : " ", NameOf(row).c_str(),
                  Cell(row.seconds, decimals).c_str(), Cell(row.cpu_seconds, decimals).c_str(),
                  Cell(row.cpu_spread, decimals).c_str(), Cell(row.accuracy, 3).c_str(),
                  Cell(row.accuracy_spread, 3).c_str(), Cell(row.error, 3).c_str());
    text += line;
    for (const auto& [name, value] :
         {std::pair{"SSIM", row.ssim}, {"detail kept", row.detail_kept}, {"LPIPS", row.lpips}})
      if (value) text += std::string("  ") + name + " " + FixedNumber(*value, 3);
    if (!row.dominated_by.empty()) text += "  dominated by " + row.dominated_by;
    text += "\n";
  }
  return text;
}

std::string CostTableCsv(const std::vector<CostRow>& rows) {
  std::string text =
      "benchmark,parameter,setting,repeats,seconds,seconds_spread,cpu_seconds,cpu_spread,"
      "accuracy,"
      "accuracy_spread,unit,error,on_pareto_front,dominated_by,ssim,detail_kept,lpips\n";
  for (const CostRow& row : rows) {
    const auto number = [](const Metric& metric) {
      return "," + (metric.value ? FixedNumber(*metric.value, 6) : std::string());
    };
    text += row.benchmark + "," + Quoted(row.parameter) + "," + Quoted(row.setting) + "," +
            std::to_string(row.repeats) + number(row.seconds) + number(row.seconds_spread) +
            number(row.cpu_seconds) + number(row.cpu_spread) + number(row.accuracy) +
            number(row.accuracy_spread) + "," + row.unit + number(row.error) + "," +
            (row.on_pareto_front ? "yes" : "no") + "," + Quoted(row.dominated_by) +
            number(Metric(row.ssim)) + number(Metric(row.detail_kept)) +
            number(Metric(row.lpips)) + "\n";
  }
  return text;
}

}  // namespace regrade
