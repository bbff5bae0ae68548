// A measured number, and a decision that was made by one: what records keep and the report
// shows.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>

namespace regrade {

// A number, or the reason why there is none. JSON has no NaN: a value that is not finite is a
// figure without value.
struct Metric {
  std::optional<double> value;
  std::string why = "not measured";  // read only while `value` is empty

  Metric() = default;
  Metric(double number) {  // NOLINT: a number is a figure
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
  std::string evidence;  // a sentence for a person
  Metric value;          // what was measured, in the unit that `evidence` names
  Metric threshold;
};

}  // namespace regrade
