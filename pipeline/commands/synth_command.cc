// regrade synth: writes a synthetic capture with its exact ground truth.
#include "pipeline/capture/synth_capture.h"
#include "pipeline/commands/command.h"

namespace regrade {

void RunSynth(const Command& command, const Arguments& arguments, Console* console) {
  ProgramOptions program;
  SynthOptions synth;
  OptionSet options;
  options.Add("Capture", &synth);
  options.Add("Program", &program);
  const auto prepared = Prepare(command, arguments, {}, &options);
  if (!prepared) return;
  const std::string& folder = prepared->words[0];
  console->BeginStage("synth");
  WriteSyntheticCapture(folder, synth, console->StageProgress());
  console->EndStage();
  console->Info("wrote " + folder + "/images and " + folder + "/truth");
}

}  // namespace regrade
