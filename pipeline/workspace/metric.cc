#include "pipeline/workspace/metric.h"

namespace regrade {

void PutMetric(const std::string& key, const Metric& metric, JsonValue* object) {
  (*object)[key] = metric.value ? JsonValue(*metric.value) : JsonValue();
  if (!metric.value) (*object)[key + "_why"] = metric.why;
}

Metric MetricAt(const JsonValue& object, const std::string& key) {
  const JsonValue& value = object.At(key);
  if (value.IsNumber()) return value.AsDouble();
  const JsonValue* why = object.Find(key + "_why");
  if (!value.IsNull() || why == nullptr || !why->IsString())
    throw InputError(
        "\"" + key + "\" is neither a number nor null with a reason in \"" + key + "_why\"",
        value.line() > 0 ? "line " + std::to_string(value.line()) : "");
  return Metric::Undefined(why->AsString());
}

}  // namespace regrade
