// The program's commands: a name, what it takes, what it does.
#pragma once

#include <string>
#include <vector>

#include "pipeline/program/console.h"
#include "pipeline/program/option_binding.h"
#include "pipeline/program/run_options.h"

namespace regrade {

using Arguments = std::vector<std::string>;

struct Command {
  const char* name;
  const char* usage;    // what stands behind the name
  const char* summary;  // one line
  void (*run)(const Command& command, const Arguments& arguments, Console* console);
};

const std::vector<Command>& AllCommands();

// Prints usage and options on stdout if --help is among the arguments, and says so.
bool PrintedHelp(const Command& command, const Arguments& arguments, const OptionSet& options);

// Throws Error(kUsage) unless there are between `least` and `most` words.
void CheckWords(const Command& command, const Arguments& words, size_t least, size_t most);

// Before any work.
void ApplyProgramOptions(const ProgramOptions& options);

void RunStages(const Command&, const Arguments&, Console*);  // run, pose, reconstruct
void RunFolder(const Command&, const Arguments&, Console*);  // stylize, render
void RunEvaluate(const Command&, const Arguments&, Console*);
void RunContactSheet(const Command&, const Arguments&, Console*);
void RunMix(const Command&, const Arguments&, Console*);
void RunTradeoff(const Command&, const Arguments&, Console*);
void RunSynth(const Command&, const Arguments&, Console*);
void RunExport(const Command&, const Arguments&, Console*);
void RunPack(const Command&, const Arguments&, Console*);
void RunDoctor(const Command&, const Arguments&, Console*);

}  // namespace regrade
