#include "pipeline/tradeoff/cost_table.h"

#include <algorithm>
#include <cstdio>

#include "pipeline/report/html_text.h"

namespace regrade {
namespace {

// Median, and half of what lies between the least and the most.
struct Spread {
  double median = 0, spread = 0;
};

Spread Of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
  return {median, 0.5 * (values.back() - values.front())};
}

// Larger is better, whatever the plane's unit.
double Merit(const PriceRow& row) {
  return PlaneOf(row.plane).more_is_better ? *row.accuracy.value : -*row.accuracy.value;
}

bool AtLeastAsGood(const PriceRow& a, const PriceRow& b) {
  return Merit(a) >= Merit(b) && *a.cpu_seconds.value <= *b.cpu_seconds.value;
}

bool Beats(const PriceRow& a, const PriceRow& b) {
  return AtLeastAsGood(a, b) && !AtLeastAsGood(b, a);
}

bool BeatsBeyondNoise(const PriceRow& a, const PriceRow& b) {
  if (!Beats(a, b) || a.repeats < 2 || b.repeats < 2) return false;
  return *b.cpu_seconds.value - *a.cpu_seconds.value >
             *a.cpu_spread.value + *b.cpu_spread.value ||
         Merit(a) - Merit(b) > *a.accuracy_spread.value + *b.accuracy_spread.value;
}

std::string NameOf(const PriceRow& row) {
  return row.knob.empty() ? row.setting : row.knob + " " + row.setting;
}

// Against the accurate end of the same knob, which may be the base.
void FillErrors(const std::vector<Variant>& variants, std::vector<PriceRow>* rows) {
  for (PriceRow& row : *rows) {
    if (row.knob.empty() || row.knob == "preset") continue;
    const auto end = std::find_if(variants.begin(), variants.end(), [&](const Variant& v) {
      return v.plane == row.plane && v.knob == row.knob && v.accurate_end;
    });
    const std::string knob = end == variants.end() ? "" : end->knob;
    const std::string value = end == variants.end() ? "" : end->value;
    for (const PriceRow& other : *rows)
      if (other.plane == row.plane && other.knob == knob &&
          (knob.empty() || other.setting == value))
        row.error = Merit(other) - Merit(row);
  }
}

void MarkFront(std::vector<PriceRow>* rows) {
  for (PriceRow& row : *rows) {
    row.on_front = true;
    for (const PriceRow& other : *rows) {
      if (other.plane != row.plane || &other == &row) continue;
      if (Beats(other, row)) row.on_front = false;
      if (row.dominated_by.empty() && BeatsBeyondNoise(other, row))
        row.dominated_by = NameOf(other);
    }
  }
}

std::string Cell(const Figure& figure, int decimals) {
  return figure.value ? FixedNumber(*figure.value, decimals) : "-";
}

// Enough digits for milliseconds and for hours.
int DecimalsFor(const Figure& seconds) { return seconds.value && *seconds.value < 1 ? 4 : 2; }

std::string Quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

}  // namespace

std::vector<PriceRow> PriceList(const std::vector<Variant>& variants,
                                const std::vector<Measurement>& measurements,
                                const std::string& base) {
  std::vector<PriceRow> rows;
  for (const Variant& variant : variants) {
    std::vector<double> seconds, cpu, accuracy;
    for (const Measurement& m : measurements) {
      if (m.plane != variant.plane || m.knob != variant.knob || m.value != variant.value)
        continue;
      seconds.push_back(m.seconds);
      cpu.push_back(m.cpu_seconds);
      accuracy.push_back(m.accuracy);
    }
    if (seconds.empty()) continue;
    const Plane& plane = PlaneOf(variant.plane);
    PriceRow row;
    row.plane = variant.plane;
    row.knob = variant.knob;
    row.setting = variant.knob.empty() ? base : variant.value;
    row.measure = plane.accuracy;
    row.unit = plane.unit;
    row.repeats = static_cast<int>(seconds.size());
    row.seconds = Of(seconds).median;
    row.seconds_spread = Of(seconds).spread;
    row.cpu_seconds = Of(cpu).median;
    row.cpu_spread = Of(cpu).spread;
    row.accuracy = Of(accuracy).median;
    row.accuracy_spread = Of(accuracy).spread;
    row.error = Figure::Undefined("it is not a value of one knob");
    rows.push_back(std::move(row));
  }
  // Presets, measured last, stand with the other rows of their plane.
  std::stable_sort(rows.begin(), rows.end(), [](const PriceRow& a, const PriceRow& b) {
    return &PlaneOf(a.plane) < &PlaneOf(b.plane);
  });
  FillErrors(variants, &rows);
  MarkFront(&rows);
  return rows;
}

std::string PriceListText(const std::vector<PriceRow>& rows) {
  std::string text, plane;
  char line[256];
  for (const PriceRow& row : rows) {
    if (row.plane != plane) {
      plane = row.plane;
      text += (text.empty() ? "" : "\n") + plane + ": " + row.measure + ", " + row.unit +
              "; time of " + PlaneOf(plane).time_of + "; * on the Pareto front\n";
      std::snprintf(line, sizeof line, "  %-40s %10s %10s %9s %10s %9s %9s\n", "", "s", "CPU s",
                    "+-", row.unit.c_str(), "+-", "error");
      text += line;
    }
    const int decimals = DecimalsFor(row.cpu_seconds);
    std::snprintf(line, sizeof line, "%s %-40s %10s %10s %9s %10s %9s %9s",
                  row.on_front ? "*" : " ", NameOf(row).c_str(),
                  Cell(row.seconds, decimals).c_str(), Cell(row.cpu_seconds, decimals).c_str(),
                  Cell(row.cpu_spread, decimals).c_str(), Cell(row.accuracy, 3).c_str(),
                  Cell(row.accuracy_spread, 3).c_str(), Cell(row.error, 3).c_str());
    text += line;
    if (!row.dominated_by.empty()) text += "  dominated by " + row.dominated_by;
    text += "\n";
  }
  return text;
}

std::string PriceListCsv(const std::vector<PriceRow>& rows) {
  std::string text =
      "plane,knob,setting,repeats,seconds,seconds_spread,cpu_seconds,cpu_spread,accuracy,"
      "accuracy_spread,unit,error,on_front,dominated_by\n";
  for (const PriceRow& row : rows) {
    const auto number = [](const Figure& figure) {
      return "," + (figure.value ? FixedNumber(*figure.value, 6) : std::string());
    };
    text += row.plane + "," + Quoted(row.knob) + "," + Quoted(row.setting) + "," +
            std::to_string(row.repeats) + number(row.seconds) + number(row.seconds_spread) +
            number(row.cpu_seconds) + number(row.cpu_spread) + number(row.accuracy) +
            number(row.accuracy_spread) + "," + row.unit + number(row.error) + "," +
            (row.on_front ? "yes" : "no") + "," + Quoted(row.dominated_by) + "\n";
  }
  return text;
}

}  // namespace regrade
