// A measured number, or the reason why there is none, and how structs of such numbers list
// their members.
//
//   struct RenderReport {
//     int frames = 0;
//     Metric frames_per_second;
//     template <typename Visit>
//     void Describe(Visit& visit) {
//       visit("frames", frames, {.label = "frames"});
//       visit("frames_per_second", frames_per_second, {.label = "speed", .unit = "frames/s"});
//     }
//   };
//
// From that one list come the JSON of stage records and of report.json, both ways (see
// metrics_json.h), and the row of the report page.
#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "pipeline/files/json_file.h"

namespace regrade {

// A number, or the reason why there is none. JSON has no NaN: a value that is not finite is a
// metric without value.
struct Metric {
  std::optional<double> value;
  std::string why = "not measured";  // meaningful only while `value` is empty
  bool infinite = false;             // the number was +inf: `value` is empty

  Metric() = default;
  Metric(double number) {  // NOLINT: a number is a metric
    if (std::isfinite(number)) {
      value = number;
    } else {
      why = std::isnan(number) ? "not a number" : "infinite: no error at all";
      infinite = number > 0 && std::isinf(number);
    }
  }
  // `why`, where given, is the reason for a missing and for an infinite number.
  explicit Metric(const std::optional<double>& number, const std::string& why = "")
      : Metric(number ? Metric(*number) : Undefined("not defined")) {
    if (!value && !why.empty()) this->why = why;
  }
  static Metric Undefined(std::string why) {
    Metric metric;
    metric.why = std::move(why);
    return metric;
  }
};

// How a member of a struct of metrics is shown and stored.
struct MetricInfo {
  const char* label = "";  // on the report page; without one the member is not in the row
  const char* unit = "";
  int decimals = 2;
  bool optional = false;  // of a text: where it is empty, the key is absent
};

// "key": number, or "key": null and "key_why": reason; where it is infinite, "key_infinite":
// true.
void PutMetric(const std::string& key, const Metric& metric, JsonValue* object);

// Throws Error(kInput), which names the key, unless there is a number, or null with its reason.
Metric MetricAt(const JsonValue& object, const std::string& key);

// One decision of the scene profile.
struct EffectReport {
  std::string name;
  bool on = false;
  std::string evidence;  // a sentence for the user
  Metric value;          // the measurement, in the unit that `evidence` names
  Metric threshold;

  template <typename Visit>
  void Describe(Visit& visit) {
    visit("name", name);
    visit("on", on);
    visit("evidence", evidence);
    visit("value", value);
    visit("threshold", threshold);
  }
};

}  // namespace regrade
