#include "pipeline/study/parameters.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/presets.h"

namespace regrade {
namespace {

std::string TextOf(const JsonValue& value) {
  if (value.IsString()) return value.AsString();
  if (!value.IsArray()) return DumpJson(value, -1);
  std::string text;
  for (const JsonValue& element : value.AsArray())
    text += (text.empty() ? "" : ",") + DumpJson(element, -1);
  return text;
}

// With a tolerance, because options are floats: 1e-3 differs between float and double.
bool Same(const JsonValue& a, const JsonValue& b) {
  if (!a.IsNumber() || !b.IsNumber()) return a == b;
  return std::abs(a.AsDouble() - b.AsDouble()) <= 1e-6 * std::abs(b.AsDouble());
}

class VariantList {
 public:
  explicit VariantList(const ParameterChoice& choice) : choice_(choice) {}

  void AddBase(const std::string& benchmark) { variants_.push_back({benchmark, "", ""}); }

  // Adds values from cheap to accurate, except the base's own, which is measured as the base.
  void Add(const MeasuredOption& measured) {
    const std::string& parameter = measured.option;
    names_.push_back(parameter);
    if (!choice_.only.empty() &&
        std::ranges::find(choice_.only, parameter) == choice_.only.end())
      return;
    for (const JsonValue& value : measured.values) {
      if (Same(value, measured.own)) continue;
      Variant variant{measured.benchmark, parameter, TextOf(value)};
      variant.options[parameter] = value;
      variant.accurate_end = measured.last_is_accurate && &value == &measured.values.back();
      variants_.push_back(std::move(variant));
    }
  }
  // Those of `all` in one benchmark, behind its base.
  void AddBenchmark(const std::string& benchmark, const std::vector<MeasuredOption>& all) {
    AddBase(benchmark);
    for (const MeasuredOption& measured : all)
      if (measured.benchmark == benchmark) Add(measured);
  }

  std::vector<Variant> Take() {
    for (const std::string& name : choice_.only)
      if (std::ranges::find(names_, name) == names_.end()) {
        std::string known;
        for (const std::string& parameter : names_)
          known += (known.empty() ? "" : ", ") + parameter;
        throw UsageError("'" + name + "' is not a measured parameter", "--parameters",
                         "parameters: " + known);
      }
    return std::move(variants_);
  }

 private:
  const ParameterChoice& choice_;
  std::vector<Variant> variants_;
  std::vector<std::string> names_;
};

std::vector<MeasuredOption> MeasuredOfStyle(const RunSettings& base) {
  const TrainNetworkOptions& network = base.network;
  const auto steps = [&](double factor) {
    return JsonValue(std::max(1, static_cast<int>(std::lround(network.steps * factor))));
  };
  return {
      {"style", "style-steps", network.steps, {steps(1 / 3.0), steps(1), steps(3)}},
      {"style", "style-patch", network.patch, {32, 8, 1}},
      {"style", "style-min-weight", network.loss.min_weight, {1e-2, 1e-3, 0.0}},
      {"style", "style-view-weight", network.loss.view_weight, {10.0, 1.0, 0.0}},
      {"style", "style-norm-steps", network.norm_steps, {1, 5, 20}},
  };
}

}  // namespace

const Benchmark& BenchmarkOf(const std::string& name) {
  for (const Benchmark& benchmark : kBenchmarks)
    if (name == benchmark.name) return benchmark;
  throw InputError("'" + name + "' is not a benchmark");
}

JsonValue PresetOptions(const std::string& preset) {
  RunSettings settings;
  ApplyPreset(preset, /*on_card=*/false, &settings);
  return OptionsOfFit(settings);
}

std::vector<Variant> VariantsOf(const RunSettings& base, const ParameterChoice& choice) {
  VariantList list(choice);
  const int size = base.pose.image_size;
  if (choice.photos && !choice.only.empty())
    list.AddBenchmark(
        "poses", {{"poses", "pose-image-size", size, {size * 6 / 10, size, size * 16 / 10}}});
  const std::vector<MeasuredOption> of_field = FitKindOf(base).measured(base);
  list.AddBenchmark("fit", of_field);
  if (choice.style) list.AddBenchmark("style", MeasuredOfStyle(base));
  list.AddBenchmark("render", of_field);
  list.AddBenchmark("flow",
                    {{"flow",
                      "flow",
                      base.consistency.flow,
                      {"dis-ultrafast", "dis-fast", "dis-medium", "farneback", "dis-tuned"}}});
  std::vector<Variant> variants = list.Take();
  for (const std::string& preset : choice.presets)
    variants.push_back({"fit", "preset", preset, PresetOptions(preset)});
  // Removes the base of benchmarks without a chosen parameter.
  std::erase_if(variants, [&](const Variant& variant) {
    return variant.parameter.empty() &&
           std::ranges::none_of(variants, [&](const Variant& other) {
             return other.benchmark == variant.benchmark && !other.parameter.empty();
           });
  });
  return variants;
}

}  // namespace regrade
