#include "pipeline/run/run_file.h"

#include "kernels/base/error.h"
#include "kernels/base/hash.h"
#include "pipeline/workspace/stage_runner.h"

namespace regrade {
namespace {

constexpr uint64_t kMaxRunFile = 16 << 20;

}  // namespace

RunFile ReadRunFile(const std::string& path) {
  try {
    const JsonValue value = ReadJsonFile(path, kMaxRunFile, ExitCode::kUsage);
    RunFile file;
    for (const JsonValue& word : value.At("arguments").AsArray())
      file.words.push_back(word.AsString());
    file.options = value.At("options");
    return file;
  } catch (const Error& error) {
    throw UsageError(error.what_failed(),
                     error.where().find(path) == std::string::npos ? path + ": " + error.where()
                                                                   : error.where(),
                     "give a run.json that regrade wrote");
  }
}

JsonValue RunFileJson(const std::string& command, const RunContext& context) {
  JsonValue fingerprints = JsonValue::Object();
  for (const char* stage : kStageNames)
    if (const auto record = context.workspace->Find(stage))
      fingerprints[stage] =
          JsonValue::Object{{"inputs", HashText(HashOf(DumpJson(record->inputs, -1)))},
                            {"outputs", record->OutputHash()}};
  JsonValue words = JsonValue::Array();
  if (!context.source.empty()) words.Append(context.source);
  JsonValue options = context.options.Values();
  // Options of one start are not repeated.
  const JsonValue start = OptionValues(context.settings.start);
  JsonValue kept = JsonValue::Object();
  for (const auto& [name, value] : options.AsObject())
    if (start.Find(name) == nullptr) kept[name] = value;
  return JsonValue::Object{{"schema", 1},
                           {"regrade", REGRADE_VERSION},
                           {"command", command},
                           {"arguments", words},
                           {"seed", context.settings.run.seed},
                           {"options", kept},
                           {"fingerprints", fingerprints}};
}

void WriteRunFile(const std::string& command, const RunContext& context) {
  WriteJsonFile(context.workspace->Path("run.json"), RunFileJson(command, context));
}

}  // namespace regrade
