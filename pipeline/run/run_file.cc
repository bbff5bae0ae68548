#include "pipeline/run/run_file.h"

#include <algorithm>
#include <array>
#include <filesystem>

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/workspace/stage_runner.h"
#include "pipeline/workspace/style_folders.h"

namespace regrade {
namespace {

constexpr uint64_t kMaxRunFile = 16 << 20;
constexpr int64_t kRunSchema = 2;

void CheckSchema(const JsonValue& run) {
  const JsonValue* schema = run.Find("schema");
  if (schema == nullptr || schema->AsInt() == kRunSchema) return;
  throw InputError(
      Concat("made by ", schema->AsInt() < kRunSchema ? "an older" : "a newer",
             " regrade (schema ", schema->AsInt(), ", this one has ", kRunSchema, ")"),
      "", "run again with another --out, or delete the output folder");
}

// Options of earlier versions, which every run.json of theirs names; and what a rate or weight
// of theirs could be instead of a number.
constexpr std::array kEarlierOptions = {"control-field",   "exact",
                                        "fit-cell-pixels", "fit-fewer-stages",
                                        "fit-field",       "fit-free-space",
                                        "fit-max-cells",   "fit-max-forward-cells",
                                        "fit-outward",     "keep-field",
                                        "match-network",   "style-embedding",
                                        "style-features",  "style-iterations",
                                        "style-regrain"};
constexpr std::array kEarlierAuto = {"fit-rate-density", "fit-rate-density-end", "tv-density",
                                     "tv-sh"};

// What stages, rates and weights begin with: those of an octree are not a grid's.
constexpr std::array kOfTheFit = {"fit-", "tv-", "prune-", "background-"};

// Without those of earlier versions.
JsonValue OptionsOf(const JsonValue& options) {
  if (!options.IsObject()) return options;  // refused where it is used
  const JsonValue* const field = options.Find("fit-field");
  const bool octree = field != nullptr && field->IsString() && field->AsString() != "uniform";
  JsonValue kept = JsonValue::Object();
  for (const auto& [name, value] : options.AsObject()) {
    if (octree && std::ranges::any_of(kOfTheFit, [&name](const char* first) {
          return name.starts_with(first);
        }))
      continue;
    const bool is_auto = value.IsString() && value.AsString() == "auto" &&
                         std::ranges::find(kEarlierAuto, name) != kEarlierAuto.end();
    if (is_auto || std::ranges::find(kEarlierOptions, name) != kEarlierOptions.end()) continue;
    const bool was_switch = name == "controls" && value.IsBool();
    kept[name] = was_switch ? JsonValue(value.AsBool() ? "on" : "off") : value;
  }
  // What were two options is one.
  if (const JsonValue* const field = options.Find("control-field");
      field != nullptr && field->IsBool() && field->AsBool())
    kept["controls"] = "field";
  if (const JsonValue* const network = options.Find("match-network");
      network != nullptr && network->IsString() && !network->AsString().empty())
    kept["match"] = "regions:" + network->AsString();
  return kept;
}

RunFile RunFileOf(const JsonValue& value) {
  CheckSchema(value);
  RunFile file;
  for (const JsonValue& word : value.At("arguments").AsArray())
    file.words.push_back(word.AsString());
  file.options = OptionsOf(value.At("options"));
  if (const JsonValue* const set_by = value.Find("set_by")) {
    for (const auto& [name, by] : set_by->AsObject()) by.AsString();  // throws
    file.set_by = *set_by;
  }
  return file;
}

// In place of the output folder, so that paths within it hold when it is moved: at the
// beginning of a text, or behind the first ':' of one such as layers:DIR.
constexpr char kOutMark[] = "{out}";

JsonValue WithFolder(const JsonValue& value, const std::string& from, const std::string& to) {
  if (value.IsArray()) {
    JsonValue::Array values;
    for (const JsonValue& part : value.AsArray()) values.push_back(WithFolder(part, from, to));
    return values;
  }
  if (!value.IsString()) return value;
  const std::string& text = value.AsString();
  const size_t colon = text.find(':');
  for (const size_t at : {size_t{0}, colon == std::string::npos ? 0 : colon + 1})
    if (text.compare(at, from.size() + 1, from + "/") == 0)
      return text.substr(0, at) + to + text.substr(at + from.size());
  return value;
}

JsonValue::Object OptionsWithFolder(const JsonValue& options, const std::string& from,
                                    const std::string& to) {
  JsonValue::Object replaced;
  for (const auto& [name, value] : options.AsObject())
    replaced.emplace_back(name, WithFolder(value, from, to));
  return replaced;
}

// The output folder that a run.json lies in, or else, as of a text, that of the run.
std::string OutputFolderOf(const std::string& path, const JsonValue& options) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path folder =
      path.empty() ? fs::path() : fs::absolute(path, error).lexically_normal().parent_path();
  const fs::path above = folder.parent_path().parent_path();  // of a style
  if (folder.parent_path().filename() == "styles" && fs::exists(above / ".regrade", error))
    return above.string();
  if (!path.empty() && fs::exists(folder / ".regrade", error)) return folder.string();
  const JsonValue* const out = options.Find("out");
  return out != nullptr && out->IsString() ? out->AsString() : folder.string();
}

RunFile InItsFolder(RunFile file, const std::string& path) {
  if (file.options.IsObject())
    file.options =
        OptionsWithFolder(file.options, kOutMark, OutputFolderOf(path, file.options));
  return file;
}

// What `read` returns, and its errors as of usage.
template <typename Read>
auto FromUser(const std::string& name, const Read& read) {
  try {
    return read();
  } catch (const Error& error) {
    throw UsageError(
        error.what_failed(), error.where().empty() ? name : error.where(),
        error.hint().empty() ? "give a run.json that regrade wrote" : error.hint());
  }
}

}  // namespace

RunFile ReadRunFile(const std::string& path) {
  return FromUser(path, [&] {
    return InItsFolder(RunFileOf(ReadJsonFile(path, kMaxRunFile, ExitCode::kUsage)), path);
  });
}

ConfigFile ReadConfig(const std::string& text) {
  const bool is_file = !text.starts_with('{');
  const std::string name = is_file ? text : "--config";
  return FromUser(name, [&]() -> ConfigFile {
    const JsonValue value = is_file ? ReadJsonFile(text, kMaxRunFile, ExitCode::kUsage)
                                    : ParseJson(text, name, ExitCode::kUsage);
    const bool of_options =
        value.IsObject() && value.Find("schema") == nullptr && value.Find("options") == nullptr;
    if (of_options) return {false, {{}, value}, name};
    return {true, InItsFolder(RunFileOf(value), is_file ? text : ""), name};
  });
}

double StrengthOf(const std::string& style) {
  StyleSource source;
  const std::string file = style + "/run.json";
  if (!std::filesystem::exists(file)) return source.strength;
  const RunFile run = ReadRunFile(file);
  OptionSet options;
  options.Add("", &source);
  if (const JsonValue* strength = run.options.Find("strength"))
    options.ApplyConfig(JsonValue::Object{{"strength", *strength}}, file);
  return source.strength;
}

JsonValue RunFileJson(const std::string& command, const RunContext& context) {
  JsonValue fingerprints = JsonValue::Object();
  for (const char* stage : kStageNames)
    if (!IsOfScene(stage) && context.style == nullptr)
      continue;
    else if (const auto record = context.FolderOf(stage).Find(stage))
      fingerprints[stage] =
          JsonValue::Object{{"inputs", HashText(HashOf(DumpJson(record->inputs, -1)))},
                            {"outputs", record->OutputHash()}};
  JsonValue words = JsonValue::Array();
  if (!context.source.empty()) words.Append(context.source);
  JsonValue options = context.options.Values();
  // Options of one start are not repeated.
  const JsonValue start = OptionValues(context.settings.start, context.parts),
                  refine = OptionValues(context.refine);
  const auto stays = [&](const std::string& name) {
    return start.Find(name) == nullptr && refine.Find(name) == nullptr;
  };
  JsonValue kept = JsonValue::Object(), set_by = JsonValue::Object();
  for (const auto& [name, value] : options.AsObject())
    if (stays(name)) kept[name] = value;
  kept = OptionsWithFolder(kept, context.settings.run.out, kOutMark);
  const JsonValue setters = context.options.Setters();
  for (const auto& [name, by] : setters.AsObject())
    if (stays(name)) set_by[name] = by;
  JsonValue run = JsonValue::Object{
      {"schema", kRunSchema}, {"regrade", REGRADE_VERSION},        {"command", command},
      {"arguments", words},   {"seed", context.settings.run.seed}, {"options", kept},
      {"set_by", set_by},     {"fingerprints", fingerprints}};
  if (context.style != nullptr && !context.settings.style.pictures.empty())
    run[kPictureHash] = PicturesHash(context.settings.style.pictures);
  return run;
}

void WriteRunFile(const std::string& command, const RunContext& context) {
  const Workspace& folder = context.style != nullptr ? *context.style : *context.workspace;
  WriteJsonFile(folder.Path("run.json"), RunFileJson(command, context));
}

}  // namespace regrade
