// Measured numbers, and decisions based on them, for records and the report.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace regrade {

// A number, or the reason why there is none. JSON has no NaN: a number that is not finite
// becomes a metric without value.
struct Metric {
  std::optional<double> value;
  std::string why = "not measured";  // read only while `value` is empty

  Metric() = default;
  Metric(double number) {  // NOLINT: a number is a metric
    if (std::isfinite(number)) {
      value = number;
    } else {
      why = std::isnan(number) ? "not a number" : "infinite: no error at all";
    }
  }
  static Metric Undefined(std::string why) {
    Metric metric;
    metric.why = std::move(why);
    return metric;
  }
};

// One decision of the scene profile.
struct EffectReport {
  std::string name;
  bool on = false;
  std::string evidence;  // a sentence
  Metric value;          // the measurement, in the unit named by `evidence`
  Metric threshold;
};

}  // namespace regrade
