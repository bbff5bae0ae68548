#include "pipeline/commands/command.h"

#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <latch>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "kernels/base/error.h"
#include "pipeline/capture/capture_store.h"
#include "pipeline/files/text.h"
#include "pipeline/program/console.h"
#include "pipeline/program/device_choice.h"
#include "pipeline/run/resolve_settings.h"
#include "pipeline/run/run_file.h"
#include "pipeline/workspace/style_folders.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {
namespace {

// libgomp ends the program where it cannot start a thread, so its threads are started here,
// after a trial with as many others. Throws Error(kResources).
void StartThreads() {
  const int count = omp_get_max_threads();
  std::latch all_started(1);
  std::vector<std::thread> trial;
  std::string problem;
  try {
    while (static_cast<int>(trial.size()) + 1 < count)
      trial.emplace_back([&all_started] { all_started.wait(); });
  } catch (const std::system_error& error) {
    problem = error.what();
  }
  all_started.count_down();
  for (std::thread& thread : trial) thread.join();
  if (!problem.empty())
    throw Error(ExitCode::kResources,
                "cannot start " + std::to_string(count) + " threads: " + problem, "regrade",
                "lower --threads, or raise the limits on memory and processes");
#pragma omp parallel
  {}
}

}  // namespace

namespace {

bool HasFlag(const Arguments& arguments, const std::string& flag) {
  const auto flags_end = std::ranges::find(arguments, "--");
  return std::find(arguments.begin(), flags_end, flag) != flags_end;
}

Arguments WordsOf(const char* text) {
  std::istringstream stream(text);
  Arguments words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

void PrintHelp(const Command& command, const Arguments& arguments, bool continues,
               const OptionSet& options) {
  const std::vector<std::string> required = RequiredOptions(command.usage);
  if (HasFlag(arguments, kHelpMan)) {
    std::printf("%s", options.ManPage(required).c_str());
  } else if (HasFlag(arguments, kHelpWords)) {
    std::printf("%s", options.CompletionWords().c_str());
  } else {
    std::printf("regrade %s %s\n%s\n", command.name, command.usage, command.summary);
    const Arguments shown = WordsOf(command.shown);
    if (HasFlag(arguments, kHelpConstants)) {
      const std::string constants = options.HelpOfConstants();
      std::printf("%s\n%s",
                  constants.empty() ? "There is nothing that --config alone changes."
                                    : "What --config alone changes, for measurements:",
                  constants.c_str());
      return;
    }
    const bool all = HasFlag(arguments, "--help-all") || shown.empty();
    std::printf("%s%s", all ? "" : "\n",
                options.Help(required, all ? Arguments() : shown).c_str());
    if (!all)
      std::printf("\nregrade %s --help-all lists all %d options.\n", command.name,
                  options.count());
    else if (!shown.empty())
      std::printf("\n--no-NAME turns off a switch that is on.\n");
    if (continues)
      std::printf(
          "\nWhat is not given is as in run.json of DIR, or of the style that is continued; "
          "what its poses and its fit need stays so.\n");
  }
}

// A folder may come from somebody else: what its run.json would run, or read elsewhere, is
// shown and asked for. Throws Error(kUsage) where nobody can answer, and after a no.
bool AcceptOutside(const std::string& run_json, const OutsideOptions& outside, bool yes) {
  std::string shown;
  for (const OptionSet::Outside& option : outside)
    shown += (shown.empty() ? "--" : ", --") + option.name + " '" + option.text + "'";
  const bool runs = std::ranges::any_of(
      outside, [](const OptionSet::Outside& option) { return option.path.empty(); });
  const std::string what = std::string("names what would be ") +
                           (runs ? "run" : "read outside of the folder") + ": " + shown;
  if (yes) return true;
  if (CanAsk() && AnsweredYes(Printable(run_json + " " + what + ". Go on with it?")))
    return true;
  throw UsageError(what, run_json,
                   "if you trust it, add --yes, or give these options yourself (constants with "
                   "--config)");
}

}  // namespace

bool AsksForHelp(const Arguments& arguments) {
  for (const char* flag : {"--help", "-h", "--help-all", kHelpConstants, kHelpMan, kHelpWords})
    if (HasFlag(arguments, flag)) return true;
  return false;
}

void CheckWords(const Command& command, const Arguments& words, size_t least, size_t most) {
  if (words.size() >= least && words.size() <= most) return;
  throw UsageError(words.size() < least ? "an argument is missing"
                                        : "one argument too many: '" + words[most] + "'",
                   std::string("regrade ") + command.name,
                   std::string("usage: regrade ") + command.name + " " + command.usage);
}

std::vector<std::string> RequiredOptions(const std::string& usage) {
  std::vector<std::string> names;
  std::istringstream words(usage);
  bool in_brackets = false;
  for (std::string word; words >> word && word != "|";) {
    in_brackets = in_brackets || word.starts_with('[');
    if (!in_brackets && word.starts_with("--")) names.push_back(word.substr(2));
    if (word.ends_with(']')) in_brackets = false;
  }
  return names;
}

std::optional<Prepared> Prepare(const Command& command, const Arguments& arguments,
                                const Preparation& preparation, OptionSet* options) {
  SettingsSources sources;
  sources.preset = preparation.preset;
  sources.taken = preparation.taken;
  if (AsksForHelp(arguments)) {
    ResolveSettings(sources, options);
    PrintHelp(
        command, arguments,
        preparation.taken.empty() && (preparation.continues_run || preparation.continues_style),
        *options);
    return std::nullopt;
  }
  Prepared prepared;
  prepared.words = options->Parse(arguments);
  if (const auto device = options->Given("device"))
    options->Replace("device", ShowOneCard(*device));
  const auto check_words = [&] {
    CheckWords(command, prepared.words, preparation.least_words, preparation.most_words);
  };
  if (preparation.continues_run || preparation.continues_style) {
    check_words();
    if (preparation.taken.empty() && options->Given("out"))
      throw UsageError("the folder that is continued has all that is made", "--out",
                       "leave it out, or copy the folder first");
    const std::string& folder = prepared.words[0];
    if (!Workspace::Exists(folder))
      throw InputError("no run has worked in this folder", folder,
                       "make one with `regrade run` or `regrade reconstruct`");
    ReadRunFile(folder + "/run.json");  // refuses folders of another schema
    const std::string name = options->Given("name").value_or("");
    const std::vector<std::string> styles = StyleNames(folder);
    const bool of_style =
        preparation.continues_style ||
        (preparation.prefers_style && std::ranges::find(styles, name) != styles.end());
    const std::string style =
        of_style ? StyleFolder(folder, ChosenStyle(folder, name)) : folder;
    sources.run_json = style + "/run.json";
    sources.folder = folder;
    sources.accept_outside = [&](const OutsideOptions& outside) {
      return AcceptOutside(sources.run_json, outside, options->Given("yes") == "true");
    };
  }
  prepared.run_words = ResolveSettings(sources, options);
  if (prepared.words.empty() && options->Given("config")) prepared.words = prepared.run_words;
  check_words();
  const int threads = static_cast<int>(options->Values().At("threads").AsInt());
  if (threads > 0) omp_set_num_threads(threads);
  StartThreads();
  return prepared;
}

void RequireValue(const std::string& value, const char* flag, const char* hint) {
  if (value.empty()) throw UsageError("its value is missing", flag, hint);
}

void RefuseRequirements(const OptionSet& options) {
  for (const char* name : {"require", "junit"})
    if (options.Given(name))
      throw UsageError("nothing is measured here", std::string("--") + name,
                       "give it to `regrade run`, `stylize`, `render` or `evaluate`");
}

Capture ReadPosedCapture(const std::string& folder) {
  const std::string poses = folder + "/poses";
  if (!std::filesystem::exists(poses + "/photos.json"))
    throw InputError("has no poses", folder,
                     "run `regrade pose PHOTOS --out " + folder + "` first");
  return ReadCapture(poses);
}

std::string AbsolutePath(const std::string& path) {
  std::error_code error;
  const auto absolute = std::filesystem::absolute(path, error);
  if (error)
    throw ResourceError("the current folder does not exist: " + error.message(), path,
                        "start in an existing folder");
  const std::filesystem::path normal = absolute.lexically_normal();
  return (normal.has_filename() ? normal : normal.parent_path()).string();  // DIR/ is DIR
}

}  // namespace regrade
