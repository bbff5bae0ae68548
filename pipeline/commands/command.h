// The program's commands: a name, what it takes, what it does.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/scene/capture.h"
#include "pipeline/program/console.h"
#include "pipeline/program/option_binding.h"
#include "pipeline/program/run_options.h"

namespace regrade {

using Arguments = std::vector<std::string>;

struct Command {
  const char* name;
  const char* usage;    // arguments and options behind the name
  const char* summary;  // one line
  void (*run)(const Command& command, const Arguments& arguments, Console* console);
  const char* shown = "";  // options that --help shows, with blanks between; empty: all
};

const std::vector<Command>& AllCommands();

// Names of the options that a usage demands: those before an alternative (" | ") and outside
// brackets.
std::vector<std::string> RequiredOptions(const std::string& usage);

// What Prepare is to read.
struct Preparation {
  size_t least_words = 1, most_words = 1;
  // The first word is the folder of a run, and its run.json sets options: those named in
  // `taken`, or all.
  bool continues_run = false;
  // The same with run.json of the style that --name chooses, or of the last one.
  bool continues_style = false;
  // With continues_run: run.json of the style that --name names, where there is one.
  bool prefers_style = false;
  std::vector<std::string> taken = {};
  std::string preset = "standard";  // where none is given
};

struct Prepared {
  Arguments words;      // what is not a flag; those of --config where none are typed
  Arguments run_words;  // of the run that is continued: PHOTOS or CAPTURE
};

// The beginning of every command. --help prints usage and the options of Command::shown,
// --help-all all of them, kHelpConstants what --config alone changes, and kHelpMan and
// kHelpWords what `regrade manual` is made of; each returns nothing. Otherwise parses the
// arguments, sets the options (ResolveSettings) and the number of threads. `options` has
// ProgramOptions among others. Throws Error(kUsage) for a wrong number of words, Error(kInput)
// for a folder without a run.
std::optional<Prepared> Prepare(const Command& command, const Arguments& arguments,
                                const Preparation& preparation, OptionSet* options);

inline constexpr char kHelpConstants[] = "--help-constants";
inline constexpr char kHelpMan[] = "--help-man", kHelpWords[] = "--help-words";

// Is --help, -h or one of the others among the flags?
bool AsksForHelp(const Arguments& arguments);

// Throws Error(kUsage) unless there are between `least` and `most` words.
void CheckWords(const Command& command, const Arguments& words, size_t least, size_t most);

// Throws Error(kUsage) for an empty value of a flag that must have one.
void RequireValue(const std::string& value, const char* flag, const char* hint);

// Of commands that measure nothing. Throws Error(kUsage) for --require and --junit.
void RefuseRequirements(const OptionSet& options);

// The poses and photos of an output folder. Throws Error(kInput) if it has none.
Capture ReadPosedCapture(const std::string& folder);

// Without links resolved. Throws Error(kResources) if the current folder does not exist.
std::string AbsolutePath(const std::string& path);

void RunStages(const Command&, const Arguments&, Console*);  // run, pose, reconstruct
void RunStylize(const Command&, const Arguments&, Console*);
void RunRetouch(const Command&, const Arguments&, Console*);
void RunRefine(const Command&, const Arguments&, Console*);
void RunRender(const Command&, const Arguments&, Console*);
void RunEvaluate(const Command&, const Arguments&, Console*);
void RunContactSheet(const Command&, const Arguments&, Console*);
void RunMix(const Command&, const Arguments&, Console*);
void RunTradeoff(const Command&, const Arguments&, Console*);
void RunStudy(const Command&, const Arguments&, Console*);
void RunSynth(const Command&, const Arguments&, Console*);
void RunExport(const Command&, const Arguments&, Console*);
void RunPage(const Command&, const Arguments&, Console*);
void RunView(const Command&, const Arguments&, Console*);
void RunNetworks(const Command&, const Arguments&, Console*);
void RunClean(const Command&, const Arguments&, Console*);
void RunManual(const Command&, const Arguments&, Console*);
void RunDoctor(const Command&, const Arguments&, Console*);

}  // namespace regrade
