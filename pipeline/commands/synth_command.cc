// regrade synth: a synthetic capture with its exact truth.
#include "pipeline/commands/command.h"
#include "pipeline/synth/synth_capture.h"

namespace regrade {

void RunSynth(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  SynthOptions synth;
  OptionSet options;
  options.Add("Capture", &synth);
  options.Add("Program", &program);
  if (PrintedHelp(command, arguments, options)) return;
  const Arguments words = options.Parse(arguments);
  options.ApplyFlags();
  CheckWords(command, words, 1, 1);
  ApplyProgramOptions(program);
  console->BeginStage("synth");
  WriteSyntheticCapture(words[0], synth, console->StageProgress());
  console->EndStage();
  console->Info("wrote " + words[0] + "/images and " + words[0] + "/truth");
}

}  // namespace regrade
