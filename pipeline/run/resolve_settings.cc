#include "pipeline/run/resolve_settings.h"

#include <algorithm>

#include "pipeline/run/run_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {
namespace {

JsonValue AllValues(const std::string& preset) {
  RunSettings settings;
  ApplyPreset(preset, &settings);
  OptionSet options;
  settings.Bind(&options);
  return options.Values();
}

// Of the options that at least one preset sets, so that a preset also resets what another one
// set before.
JsonValue PresetValues(const std::string& preset) {
  const JsonValue values = AllValues(preset), plain = AllValues("standard");
  const JsonValue network = OptionValues(TrainNetworkOptions());
  std::vector<JsonValue> presets;
  for (const char* name : kPresets) presets.push_back(AllValues(name));
  JsonValue set = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject()) {
    const auto differs = [&plain, &key = name](const JsonValue& other) {
      return !(other.At(key) == plain.At(key));
    };
    if (network.Find(name) != nullptr || std::ranges::any_of(presets, differs))
      set[name] = value;
  }
  return set;
}

JsonValue RecipeValues(const std::string& recipe) {
  TrainNetworkOptions network;
  ApplyStyleRecipe(recipe, &network);
  return OptionValues(network);
}

// The rates and regularisers that suit a field of another kind than the settings' so far.
JsonValue FieldValues(const std::string& field) {
  FitOptions other;
  if (field == "uniform") other.MakeUniform();
  const JsonValue values = OptionValues(other);
  FitOptions uniform;
  uniform.MakeUniform();
  const JsonValue plain = OptionValues(FitOptions()), changed = OptionValues(uniform);
  JsonValue set = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject())
    if (!(plain.At(name) == changed.At(name))) set[name] = value;
  return set;
}

// Writes those of the values that the set has.
void ApplyKnown(const JsonValue& values, const std::string& where, OptionSet* options) {
  const JsonValue known = options->Values();
  JsonValue kept = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject())
    if (known.Find(name) != nullptr) kept[name] = value;
  options->ApplyConfig(kept, where);
}

void ApplyField(const std::string& field, OptionSet* options) {
  const JsonValue values = options->Values();
  const JsonValue* now = values.Find("fit-field");
  if (now != nullptr && now->AsString() != field)
    ApplyKnown(FieldValues(field), "--fit-field", options);
}

void ApplyRunFile(const RunFile& file, const std::string& path,
                  const std::vector<std::string>& taken, OptionSet* options) {
  if (taken.empty()) {
    const JsonValue* preset = file.options.IsObject() ? file.options.Find("preset") : nullptr;
    // An unknown preset is refused below, with its line.
    if (preset != nullptr && preset->IsString() && IsPreset(preset->AsString()))
      ApplyKnown(PresetValues(preset->AsString()), path, options);
    options->ApplyConfig(file.options, path);
    return;
  }
  JsonValue kept = JsonValue::Object();
  for (const std::string& name : taken)
    if (const JsonValue* value = file.options.Find(name)) kept[name] = *value;
  options->ApplyConfig(kept, path);
}

}  // namespace

std::vector<std::string> ResolveSettings(const SettingsSources& sources, OptionSet* options) {
  std::vector<std::string> words;
  ApplyKnown(PresetValues(sources.preset), "--preset", options);
  if (!sources.run_json.empty()) {
    const RunFile file = ReadRunFile(sources.run_json);
    ApplyRunFile(file, sources.run_json, sources.taken, options);
    words = file.words;
  }
  if (const auto config = options->Given("config")) {
    const RunFile file = ReadRunFile(*config);
    ApplyRunFile(file, *config, {}, options);
    if (sources.run_json.empty()) words = file.words;
  }
  if (const auto preset = options->Given("preset"))
    ApplyKnown(PresetValues(*preset), "--preset", options);
  if (const auto recipe = options->Given("recipe"))
    ApplyKnown(RecipeValues(*recipe), "--recipe", options);
  if (const auto field = options->Given("fit-field")) ApplyField(*field, options);
  options->ApplyFlags();
  const JsonValue values = options->Values();
  const JsonValue *reproducible = values.Find("reproducible"), *device = values.Find("device");
  if (reproducible != nullptr && reproducible->AsBool() && device != nullptr &&
      device->AsString() == "cuda")
    ApplyKnown(JsonValue::Object{{"fit-exact-sums", true}, {"style-exact-sums", true}},
               "--reproducible", options);
  return words;
}

}  // namespace regrade
