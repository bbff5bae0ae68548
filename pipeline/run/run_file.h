// run.json: every option in effect; --config run.json repeats the run.
#pragma once

#include <string>
#include <vector>

#include "pipeline/run/run_context.h"

namespace regrade {

struct RunFile {
  std::vector<std::string> words;          // arguments that are not options, paths absolute
  JsonValue options;                       // object, without options that earlier versions had
  JsonValue set_by = JsonValue::Object();  // see OptionSet::Setters
};

// Throws Error(kUsage) with line and column for what is not such a file, or of another schema.
RunFile ReadRunFile(const std::string& path);

// The value of --config: a run.json, or some options, {"name": value, ...}, in a file or as the
// text itself.
struct ConfigFile {
  bool is_run = false;
  RunFile run;       // of some options: without words
  std::string name;  // for errors
};
// Throws as ReadRunFile.
ConfigFile ReadConfig(const std::string& text);

// The strength in run.json of a style's folder, 1 without that file. Throws Error(kUsage) for
// one that --strength would not take.
double StrengthOf(const std::string& style);

// The content for `command`, with the fingerprints of finished stages; of the style's folder,
// if a style is chosen, with its picture's hash (style_folders.h).
JsonValue RunFileJson(const std::string& command, const RunContext& context);

// Into the folder of the chosen style, or else the output folder.
void WriteRunFile(const std::string& command, const RunContext& context);

}  // namespace regrade
