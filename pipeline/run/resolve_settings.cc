#include "pipeline/run/resolve_settings.h"

#include <algorithm>
#include <filesystem>

#include "kernels/base/error.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/paper_config.h"
#include "pipeline/run/presets.h"
#include "pipeline/run/run_file.h"
#include "pipeline/run/run_settings.h"

namespace regrade {
namespace {

JsonValue AllValues(const std::string& preset, bool on_card) {
  RunSettings settings;
  ApplyPreset(preset, on_card, &settings);
  OptionSet options;
  settings.Bind(&options);
  return options.Values();
}

// Of the options that at least one preset or configuration of the paper sets, so that a preset
// also resets what another one set before.
JsonValue PresetValues(const std::string& preset, bool on_card) {
  const JsonValue values = AllValues(preset, on_card), plain = AllValues("standard", on_card);
  const JsonValue network = OptionValues(TrainNetworkOptions());
  std::vector<JsonValue> presets;
  for (const char* name : kPresets) presets.push_back(AllValues(name, on_card));
  for (const char* name : kPaperConfigs) presets.push_back(PaperValues(name));
  JsonValue set = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject()) {
    const auto differs = [&plain, &key = name](const JsonValue& other) {
      const JsonValue* const set = other.Find(key);
      return set != nullptr && !(*set == plain.At(key));
    };
    if (network.Find(name) != nullptr || name == kPaperConfig ||
        std::ranges::any_of(presets, differs))
      set[name] = value;
  }
  return set;
}

JsonValue RecipeValues(const std::string& recipe) {
  TrainNetworkOptions network;
  ApplyStyleRecipe(recipe, &network);
  return OptionValues(network);
}

// Writes those of the values that the set has.
void ApplyKnown(const JsonValue& values, const std::string& where, OptionSet* options) {
  const JsonValue known = options->Values();
  JsonValue kept = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject())
    if (known.Find(name) != nullptr) kept[name] = value;
  options->ApplyConfig(kept, where);
}

// Refuses flags and constants of a kind of field that the run does not fit. Without photos,
// --field is another option.
void RefuseFlagsOfOtherField(const OptionSet& options, const ConfigFile& config) {
  const JsonValue values = options.Values();
  const JsonValue* const field = values.Find("field");
  if (field == nullptr || values.Find("photo-size") == nullptr) return;
  const std::string& own = field->AsString();
  for (const FitKind* other : FitKinds()) {
    if (own == other->name) continue;
    const JsonValue flags = other->options({});
    for (const auto& [name, value] : flags.AsObject())
      if (options.Given(name) || (!config.is_run && config.run.options.Find(name) != nullptr))
        throw UsageError("this run fits " + own, options.IsConstant(name) ? name : "--" + name,
                         Concat("leave it out, or add --field ", other->name));
  }
}

// What the flags say, or else the defaults; false for a command without --device.
bool OnCard(const OptionSet& options) {
  const JsonValue values = options.Values();
  const JsonValue *device = values.Find("device"), *reproducible = values.Find("reproducible");
  if (device == nullptr) return false;
  return PrefersCard(options.Given("device").value_or(device->AsString()),
                     options.Given("reproducible").has_value() ||
                         (reproducible != nullptr && reproducible->AsBool()));
}

bool IsInside(const std::string& path, const std::string& folder) {
  if (folder.empty()) return false;
  std::error_code error;
  const std::filesystem::path at = std::filesystem::weakly_canonical(path, error),
                              root = std::filesystem::weakly_canonical(folder, error);
  return !error &&
         std::mismatch(root.begin(), root.end(), at.begin(), at.end()).first == root.end();
}

// The options of a folder that may come from somebody else, without those that are refused.
JsonValue OfFolder(const RunFile& file, const SettingsSources& sources, const JsonValue& config,
                   const OptionSet& options) {
  OutsideOptions outside = options.OutsideOf(file.options);
  std::erase_if(outside, [&](const OptionSet::Outside& option) {
    const bool taken = sources.taken.empty() ||
                       std::ranges::find(sources.taken, option.name) != sources.taken.end();
    return !taken || options.Given(option.name) || config.Find(option.name) != nullptr ||
           (!option.path.empty() && IsInside(option.path, sources.folder));
  });
  const bool accepted =
      outside.empty() || (sources.accept_outside && sources.accept_outside(outside));
  JsonValue kept = JsonValue::Object();
  if (!file.options.IsObject()) return file.options;  // refused below, with its line
  for (const auto& [name, value] : file.options.AsObject()) {
    const bool refused =
        !accepted &&
        std::ranges::find(outside, name, &OptionSet::Outside::name) != outside.end();
    if (!refused && !options.IsOnce(name)) kept[name] = value;
  }
  return kept;
}

// Writes what differs from the options or was set by name, so that the rest stays its preset's.
void ApplyWhatDiffers(const RunFile& file, const std::string& path, OptionSet* options) {
  JsonValue set = JsonValue::Object();
  const JsonValue now = options->Values();
  for (const auto& [name, value] : file.options.AsObject()) {
    const JsonValue* const current = now.Find(name);
    if (current == nullptr || !(*current == value) || file.set_by.Find(name) != nullptr)
      set[name] = value;
  }
  options->ApplyConfig(set, path);
  options->NoteSetters(file.set_by);
}

void ApplyRunFile(const RunFile& file, const std::string& path,
                  const std::vector<std::string>& taken, bool on_card, OptionSet* options) {
  if (taken.empty()) {
    const JsonValue* preset = file.options.IsObject() ? file.options.Find("preset") : nullptr;
    // An unknown preset is refused below, with its line.
    if (preset != nullptr && preset->IsString() && IsPreset(preset->AsString()))
      ApplyKnown(PresetValues(preset->AsString(), on_card),
                 OptionSet::kPresetOf + preset->AsString(), options);
    if (!file.options.IsObject()) return options->ApplyConfig(file.options, path);  // refused
    return ApplyWhatDiffers(file, path, options);
  }
  JsonValue kept = JsonValue::Object();
  for (const std::string& name : taken)
    if (const JsonValue* value = file.options.Find(name)) kept[name] = *value;
  options->ApplyConfig(kept, path);
  options->NoteSetters(file.set_by);
}

}  // namespace

std::vector<std::string> ResolveSettings(const SettingsSources& sources, OptionSet* options) {
  std::vector<std::string> words;
  const bool on_card = OnCard(*options);
  // Not to a command that no preset is meant for: `regrade synth` has --effects of its own.
  if (options->Values().Find("preset") != nullptr || !sources.run_json.empty())
    ApplyKnown(PresetValues(sources.preset, on_card), OptionSet::kPresetOf + sources.preset,
               options);
  const auto config = options->Given("config");
  const ConfigFile given = config ? ReadConfig(*config) : ConfigFile();
  if (!sources.run_json.empty()) {
    RunFile file = ReadRunFile(sources.run_json);
    file.options = OfFolder(file, sources, given.run.options, *options);
    // Before there was a choice, runs had voxels.
    if (file.options.IsObject() && file.options.Find("field") == nullptr)
      file.options["field"] = "voxels";
    ApplyRunFile(file, sources.run_json, sources.taken, on_card, options);
    words = file.words;
  }
  if (given.is_run) {
    ApplyRunFile(given.run, given.name, {}, on_card, options);
    if (sources.run_json.empty()) words = given.run.words;
  }
  if (const auto preset = options->Given("preset"))
    ApplyKnown(PresetValues(*preset, on_card), OptionSet::kPresetOf + *preset, options);
  if (const JsonValue* const paper =
          given.is_run ? nullptr : given.run.options.Find(kPaperConfig);
      paper != nullptr && paper->IsString() && paper->AsString() != "auto") {
    const JsonValue values = options->Values();
    if (const JsonValue* preset = values.Find("preset");
        options->Given("preset").value_or(preset != nullptr ? preset->AsString() : "") ==
        "paper")
      ApplyKnown(PaperValues(paper->AsString()), kPaperConfig, options);
  }
  if (const auto recipe = options->Given("recipe"))
    ApplyKnown(RecipeValues(*recipe), "--recipe", options);
  if (config && !given.is_run) options->ApplyConfig(given.run.options, given.name);
  options->ApplyFlags();
  RefuseFlagsOfOtherField(*options, given);
  const JsonValue values = options->Values();
  const JsonValue *reproducible = values.Find("reproducible"), *device = values.Find("device");
  if (reproducible != nullptr && reproducible->AsBool() && device != nullptr &&
      device->AsString() == "cuda")
    ApplyKnown(JsonValue::Object{{"fit-exact-sums", true}, {"style-exact-sums", true}},
               "--reproducible", options);
  return words;
}

}  // namespace regrade
