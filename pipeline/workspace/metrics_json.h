// JSON of structs of metrics, from their Describe (see metric.h).
//
// A member is a Metric, bool, int, int64_t, double, std::string, a struct of metrics, a
// std::vector of these, or a curve: std::pair of step and value. The key of an empty
// std::optional is absent; every other key must be there when it is read.
#pragma once

#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "pipeline/workspace/metric.h"

namespace regrade {

namespace metrics_json {

template <typename T>
inline constexpr bool kIsOptional = false;
template <typename T>
inline constexpr bool kIsOptional<std::optional<T>> = true;
template <typename T>
inline constexpr bool kIsVector = false;
template <typename T>
inline constexpr bool kIsVector<std::vector<T>> = true;
template <typename T>
inline constexpr bool kIsPair = false;
template <typename A, typename B>
inline constexpr bool kIsPair<std::pair<A, B>> = true;

template <typename T>
JsonValue ValueToJson(T& value);
template <typename T>
T ValueFromJson(const JsonValue& json);

struct Writer {
  JsonValue* object;

  template <typename T>
  void operator()(const char* key, T& member, const MetricInfo& info = {}) {
    if constexpr (std::is_same_v<T, Metric>) {
      PutMetric(key, member, object);
    } else if constexpr (kIsOptional<T>) {
      if (member) (*object)[key] = ValueToJson(*member);
    } else {
      if constexpr (std::is_same_v<T, std::string>)
        if (info.optional && member.empty()) return;
      (*object)[key] = ValueToJson(member);
    }
  }

  // A number of a library without Metric: null with its reason where it is missing or infinite.
  void OrNull(const char* key, std::optional<double>& member, const char* why = "") {
    PutMetric(key, Metric(member, why), object);
  }
};

struct Reader {
  const JsonValue& object;

  template <typename T>
  void operator()(const char* key, T& member, const MetricInfo& info = {}) {
    if constexpr (std::is_same_v<T, Metric>) {
      member = MetricAt(object, key);
    } else if constexpr (kIsOptional<T>) {
      member.reset();
      if (const JsonValue* value = object.Find(key))
        member = Read<typename T::value_type>(key, *value);
    } else {
      const bool may_be_absent = std::is_same_v<T, std::string> && info.optional;
      if (may_be_absent && object.Find(key) == nullptr)
        member = T();
      else
        member = Read<T>(key, object.At(key));
    }
  }

  void OrNull(const char* key, std::optional<double>& member, const char* = "") {
    const Metric metric = MetricAt(object, key);
    member = metric.infinite ? std::numeric_limits<double>::infinity() : metric.value;
  }

  // A wrong kind of value names its key; a missing one has been named already.
  template <typename T>
  static T Read(const char* key, const JsonValue& value) {
    if constexpr (!std::is_arithmetic_v<T> && !std::is_same_v<T, std::string>) {
      return ValueFromJson<T>(value);
    } else {
      try {
        return ValueFromJson<T>(value);
      } catch (const Error& error) {
        throw Error(error.code(), "\"" + std::string(key) + "\": " + error.what_failed(),
                    error.where());
      }
    }
  }
};

template <typename T>
JsonValue ValueToJson(T& value) {
  if constexpr (std::is_arithmetic_v<T> || std::is_same_v<T, std::string>) {
    return JsonValue(value);
  } else if constexpr (std::is_same_v<T, Metric>) {
    return value.value ? JsonValue(*value.value) : JsonValue();
  } else if constexpr (kIsPair<T>) {
    return JsonValue::Array{ValueToJson(value.first), ValueToJson(value.second)};
  } else if constexpr (kIsVector<T>) {
    JsonValue::Array array;
    for (auto& element : value) array.push_back(ValueToJson(element));
    return array;
  } else {
    JsonValue object = JsonValue::Object();
    Writer writer{&object};
    value.Describe(writer);
    return object;
  }
}

template <typename T>
T ValueFromJson(const JsonValue& json) {
  if constexpr (std::is_same_v<T, bool>) {
    return json.AsBool();
  } else if constexpr (std::is_integral_v<T>) {
    const int64_t value = json.AsInt();
    if (!std::in_range<T>(value)) throw InputError("number out of range", json.Place());
    return static_cast<T>(value);
  } else if constexpr (std::is_floating_point_v<T>) {
    return json.AsDouble();
  } else if constexpr (std::is_same_v<T, std::string>) {
    return json.AsString();
  } else if constexpr (std::is_same_v<T, Metric>) {
    return json.IsNull() ? Metric::Undefined("not defined") : Metric(json.AsDouble());
  } else if constexpr (kIsPair<T>) {
    const JsonValue::Array& pair = json.AsArray();
    if (pair.size() != 2) throw InputError("a pair of numbers is expected", json.Place());
    return {ValueFromJson<typename T::first_type>(pair[0]),
            ValueFromJson<typename T::second_type>(pair[1])};
  } else if constexpr (kIsVector<T>) {
    T values;
    for (const JsonValue& element : json.AsArray())
      values.push_back(ValueFromJson<typename T::value_type>(element));
    return values;
  } else {
    T value;
    Reader reader{json};
    value.Describe(reader);
    return value;
  }
}

}  // namespace metrics_json

// Adds the members of `metrics` to an object.
template <typename Metrics>
void PutMetrics(Metrics metrics, JsonValue* object) {
  metrics_json::Writer writer{object};
  metrics.Describe(writer);
}

// A struct of metrics, or a std::vector of them.
template <typename Metrics>
JsonValue MetricsToJson(Metrics metrics) {
  return metrics_json::ValueToJson(metrics);
}

// Throws Error(kInput), which names the key and its line, where a key is missing or has another
// kind of value. Keys that `Metrics` does not have are ignored.
template <typename Metrics>
Metrics MetricsFromJson(const JsonValue& json) {
  return metrics_json::ValueFromJson<Metrics>(json);
}

}  // namespace regrade
