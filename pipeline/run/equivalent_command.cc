#include "pipeline/run/equivalent_command.h"

#include "pipeline/program/device_choice.h"
#include "pipeline/run/fit_kind.h"
#include "pipeline/run/presets.h"

namespace regrade {
namespace {

void AddFlag(const std::string& name, const JsonValue& value, std::vector<std::string>* words) {
  if (value.IsBool()) {
    words->push_back((value.AsBool() ? "--" : "--no-") + name);
    return;
  }
  if (value.IsArray() && !value.AsArray().empty() && value.AsArray()[0].IsString()) {
    for (const JsonValue& element : value.AsArray())
      words->insert(words->end(), {"--" + name, element.AsString()});
    return;
  }
  std::string text;
  if (value.IsString()) {
    text = value.AsString();
  } else if (value.IsArray()) {
    for (const JsonValue& element : value.AsArray())
      text += (text.empty() ? "" : ",") + DumpJson(element, -1);
  } else {
    text = DumpJson(value, -1);
  }
  words->push_back("--" + name);
  words->push_back(text);
}

}  // namespace

std::vector<std::string> EquivalentCommand(const RunContext& context) {
  RunSettings plain;
  OptionSet plain_options;
  plain.Bind(&plain_options);
  const std::string& preset = context.settings.run.preset;
  const RunOptions& run = context.settings.run;
  ApplyPreset(preset, PrefersCard(run.device, run.reproducible), &plain);
  const JsonValue before = plain_options.Values(),
                  start = OptionValues(plain.start, context.parts),
                  program = OptionValues(plain.program);
  std::vector<std::string> words = {"regrade", "run"};
  if (!context.source.empty()) words.push_back(context.source);
  if (preset != RunSettings().run.preset) words.insert(words.end(), {"--preset", preset});
  const JsonValue values = context.options.Values();
  JsonValue refused = JsonValue::Object();  // flags of another kind of field
  for (const FitKind* kind : FitKinds()) {
    if (kind == &FitKindOf(context.settings)) continue;
    const JsonValue flags = kind->options({});
    for (const auto& [name, value] : flags.AsObject()) refused[name] = value;
  }
  JsonValue constants = JsonValue::Object();
  for (const auto& [name, value] : values.AsObject()) {
    if (name == "preset" || start.Find(name) != nullptr || program.Find(name) != nullptr ||
        refused.Find(name) != nullptr)
      continue;
    if (before.At(name) == value) continue;
    if (context.options.IsConstant(name))
      constants[name] = value;
    else
      AddFlag(name, value, &words);
  }
  if (!constants.AsObject().empty())
    words.insert(words.end(), {"--config", DumpJson(constants, -1)});
  return words;
}

}  // namespace regrade
