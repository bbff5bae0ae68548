#include "pipeline/tradeoff/parameters.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/run/presets.h"

namespace regrade {
namespace {

JsonValue Numbers(const std::vector<int>& values) {
  return JsonValue::Array(values.begin(), values.end());
}

std::vector<int> Scaled(std::vector<int> values, double factor, int least) {
  for (int& value : values)
    value = std::max(least, static_cast<int>(std::lround(value * factor)));
  return values;
}

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

  // Adds values from cheap to accurate, except the base's `own`, which is measured as the base.
  void Add(const std::string& benchmark, const std::string& parameter, const JsonValue& own,
           const std::vector<JsonValue>& values, bool last_is_accurate = true) {
    names_.push_back(parameter);
    if (!choice_.only.empty() &&
        std::ranges::find(choice_.only, parameter) == choice_.only.end())
      return;
    for (const JsonValue& value : values) {
      if (Same(value, own)) continue;
      Variant variant{benchmark, parameter, TextOf(value)};
      variant.options[parameter] = value;
      variant.accurate_end = last_is_accurate && &value == &values.back();
      variants_.push_back(std::move(variant));
    }
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

void AddSplatParameters(const SplatFitOptions& splats, VariantList* list) {
  const auto steps = [&](double factor) {
    return JsonValue(std::max(1, static_cast<int>(std::lround(splats.steps * factor))));
  };
  const auto most = [&](float factor) { return factor * splats.thousands; };
  list->Add("fit", "splat-steps", splats.steps, {steps(0.25), steps(0.5), steps(1), steps(2)});
  list->Add("fit", "splats", splats.thousands, {most(0.25f), most(0.5f), most(1), most(2)});
  list->Add("fit", "splat-degree", splats.sh_degree, {0, 1, 2});
}

void AddVoxelParameters(const RunSettings& base, VariantList* list) {
  const FitOptions& fit = base.fit;
  const auto steps = [&](double factor) { return Numbers(Scaled(fit.steps, factor, 1)); };
  const auto grids = [&](double factor) {
    return Numbers(Scaled(fit.resolutions, factor, 16));
  };
  const float step = fit.step, stop = fit.stop_transmittance;
  list->Add("fit", "fit-steps", steps(1), {steps(0.25), steps(0.5), steps(1), steps(2)});
  list->Add("fit", "fit-resolutions", grids(1), {grids(0.67), grids(1), grids(1.33)});
  list->Add("fit", "fit-step-size", step, {2 * step, step, 0.5 * step});
  list->Add("fit", "fit-stop", stop, {1e-2, 1e-3, 1e-4, 1e-6});
  list->Add("fit", "sh-degree", fit.sh_degree, {0, 1, 2});
  // Neither end is the accurate one: errors are relative to the base.
  list->Add("fit", "fit-view-bound", fit.view_bound, {0.1, 0.2, 0.4, 1e6}, false);
  // 4: sums do not depend on the number of threads.
  list->Add("fit", "fit-shards", fit.shards, {0, 4});
}

void AddStyleParameters(const RunSettings& base, VariantList* list) {
  const TrainNetworkOptions& network = base.network;
  const auto steps = [&](double factor) {
    return JsonValue(std::max(1, static_cast<int>(std::lround(network.steps * factor))));
  };
  list->Add("style", "style-steps", network.steps, {steps(1 / 3.0), steps(1), steps(3)});
  list->Add("style", "style-patch", network.patch, {32, 8, 1});
  list->Add("style", "style-min-weight", network.loss.min_weight, {1e-2, 1e-3, 0.0});
  list->Add("style", "style-view-weight", network.loss.view_weight, {10.0, 1.0, 0.0});
  list->Add("style", "style-norm-steps", network.norm_steps, {1, 5, 20});
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
  if (choice.poses) {
    list.AddBase("poses");
    const int size = base.pose.image_size;
    list.Add("poses", "pose-image-size", size, {size * 6 / 10, size, size * 16 / 10});
  }
  list.AddBase("fit");
  if (base.scene.UsesSplats())
    AddSplatParameters(base.splats, &list);
  else
    AddVoxelParameters(base, &list);
  if (choice.style) {
    list.AddBase("style");
    AddStyleParameters(base, &list);
  }
  if (!base.scene.UsesSplats()) {
    list.AddBase("render");
    // Ray marching, which has no options in a run: films use the field's step and 1e-4.
    list.Add("render", "ray-stop", nullptr, {1e-2, 1e-3, 0.0});
    list.Add("render", "ray-step", nullptr, {2.0, 0.5});
  }
  list.AddBase("flow");
  list.Add("flow", "flow", base.consistency.flow,
           {"dis-ultrafast", "dis-fast", "dis-medium", "farneback", "dis-tuned"});
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
