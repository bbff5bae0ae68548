#include "pipeline/workspace/metric.h"

namespace regrade {

void PutMetric(const std::string& key, const Metric& metric, JsonValue* object) {
  (*object)[key] = metric.value ? JsonValue(*metric.value) : JsonValue();
  if (!metric.value) (*object)[key + "_why"] = metric.why;
  if (metric.infinite) (*object)[key + "_infinite"] = true;
}

Metric MetricAt(const JsonValue& object, const std::string& key) {
  const JsonValue& value = object.At(key);
  if (value.IsNumber()) return value.AsDouble();
  const JsonValue* why = object.Find(key + "_why");
  if (!value.IsNull() || why == nullptr || !why->IsString())
    throw InputError(
        "\"" + key + "\" is neither a number nor null with a reason in \"" + key + "_why\"",
        value.line() > 0 ? "line " + std::to_string(value.line()) : "");
  Metric metric = Metric::Undefined(why->AsString());
  const JsonValue* infinite = object.Find(key + "_infinite");
  metric.infinite = infinite != nullptr && infinite->AsBool();
  return metric;
}

}  // namespace regrade
