#include "pipeline/commands/command.h"

namespace regrade {

const std::vector<Command>& AllCommands() {
  static const std::vector<Command> commands = {
      {"run", "PHOTOS|CAPTURE --style PICTURE --out DIR [OPTIONS]",
       "photos and a style picture become a styled scene, with films and a report", RunStages},
      {"pose", "PHOTOS --out DIR [OPTIONS]", "finds where each photo was taken", RunStages},
      {"reconstruct", "PHOTOS|CAPTURE --out DIR [OPTIONS]",
       "fits a radiance field to the photos", RunStages},
      {"stylize", "DIR --style PICTURE [OPTIONS]",
       "gives a finished reconstruction another style, and measures it", RunFolder},
      {"render", "DIR [OPTIONS]", "renders and measures a styled scene again", RunFolder},
      {"mix", "DIR [STYLED.npz|DIR ...] --out FOLDER [OPTIONS]",
       "a film that turns from the scene as it was into its style, and on into others", RunMix},
      {"contact-sheet", "DIR STYLE... --out FILE.png [OPTIONS]",
       "one picture of what each way of styling makes of a reconstruction", RunContactSheet},
      {"evaluate",
       "DIR [OPTIONS] | --frames DIR [--reference DIR] [--target DIR] [--style PICTURE]",
       "measures consistency and fidelity, of a run or of any program's frames", RunEvaluate},
      {"tradeoff", "PHOTOS|CAPTURE|DIR --out DIR [--style PICTURE] [OPTIONS] | --predict DIR",
       "measures here what each parameter costs in time and buys in accuracy", RunTradeoff},
      {"synth", "OUT [OPTIONS]", "writes a synthetic capture with its exact truth", RunSynth},
      {"export", "DIR --out FOLDER [OPTIONS]",
       "photos and poses for other programs: COLMAP text or binary, transforms.json",
       RunExport},
      {"pack", "DIR --out FILE [OPTIONS]",
       "a posed capture in one file, for regrade_gpu on a bare GPU machine", RunPack},
      {"doctor", "[OPTIONS]", "what is installed, and what will run where", RunDoctor},
  };
  return commands;
}

}  // namespace regrade
