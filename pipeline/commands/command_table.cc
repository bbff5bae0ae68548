#include "pipeline/commands/command.h"

namespace regrade {

const std::vector<Command>& AllCommands() {
  static const std::vector<Command> commands = {
      {"run", "PHOTOS|CAPTURE|SPLATS --style PICTURE [--style PICTURE ...] --out DIR [OPTIONS]",
       "makes a styled 3D scene, films and a report from photos, or from a file of splats, and "
       "a style picture",
       RunStages,
       "out preset style name strength method masks photo-masks cameras films film-seconds "
       "film-size "
       "device restart-from dry-run verbose"},
      {"pose", "PHOTOS --out DIR [OPTIONS]", "finds the camera pose of each photo", RunStages,
       "out photo-masks video-frames device restart-from dry-run verbose"},
      {"reconstruct", "PHOTOS|CAPTURE --out DIR [OPTIONS]",
       "fits a radiance field to the photos", RunStages,
       "out preset photo-masks video-frames max-memory device restart-from dry-run verbose"},
      {"refine", "DIR [--preset NAME] [OPTIONS]",
       "fits the splats of a finished reconstruction in more detail, block by block: for "
       "scenes that do not fit into memory, and for several machines",
       RunRefine,
       "blocks part preset splats splat-steps photo-size max-memory device dry-run "
       "verbose"},
      {"stylize", "DIR [--style PICTURE ...] [--name NAME] [OPTIONS]",
       "applies further styles to a finished reconstruction, each in DIR/styles/NAME",
       RunStylize,
       "preset style match name strength method masks style-mask film-seconds film-size device "
       "restart-from dry-run verbose"},
      {"retouch", "DIR --photo NAME [--from render] [--edited PICTURE] [OPTIONS]",
       "lets the scene follow one retouched photo, as a style in DIR/styles/NAME", RunRetouch,
       "photo edited from vignette preset name strength film-seconds film-size device "
       "dry-run verbose"},
      {"render", "DIR [OPTIONS] | DIR --path FILE.json [OPTIONS]",
       "renders and measures a styled scene again, or renders the film of a page's camera path",
       RunRender,
       "photo size format name strength path film-seconds film-size fps part until device "
       "dry-run verbose"},
      {"mix", "DIR [NAME|STYLED.npz ...] --out FOLDER [OPTIONS]",
       "makes a film that blends from the unstyled scene into one or more styles", RunMix},
      {"contact-sheet", "DIR [NAME...] --out FILE.png [OPTIONS]",
       "makes one picture that compares the styles of a folder", RunContactSheet},
      {"evaluate",
       "DIR [OPTIONS] | --frames DIR [DIR ...] [--name TEXT ...] [--reference DIR] "
       "[--target DIR] [--style PICTURE] | --splats FILE [FILE ...] --reference FILE "
       "[--cameras CAPTURE]",
       "measures consistency and fidelity, of a run or of any program's frames or splats",
       RunEvaluate},
      {"study", "A B [C ...] --out FILE.html [OPTIONS] | ANSWERS.json ...",
       "makes a page that asks people which film they prefer; of their answers it tells "
       "preference shares with intervals, Bradley-Terry strengths, and a test of each pair",
       RunStudy},
      {"tradeoff", "PHOTOS|CAPTURE|DIR --out DIR [--style PICTURE] [OPTIONS]",
       "measures on this machine how each parameter trades time for accuracy", RunTradeoff,
       "out preset style parameters presets repeats budget dry-run verbose"},
      {"synth", "OUT [OPTIONS]", "writes a synthetic capture with its exact ground truth",
       RunSynth},
      {"export", "DIR --out FOLDER|LOOK.cube [OPTIONS]",
       "writes photos and poses for COLMAP, nerfstudio and instant-ngp, splats for viewers and "
       "engines, voxels for svox2 or as points, or a style as a LUT",
       RunExport},
      {"page", "DIR [STYLE ...] --out FILE.html [OPTIONS]",
       "writes the scene and its styles as one page, to walk through in a browser", RunPage},
      {"view", "DIR [STYLE ...] [OPTIONS]",
       "serves the page to a browser on this machine: drop a picture, and its style is learned",
       RunView},
      {"clean", "DIR [OPTIONS]", "removes what can be made again from a run's folder",
       RunClean},
      {"networks", "list | remove NAME",
       "lists or removes the networks that `--method pca-kd` fetched", RunNetworks},
      {"manual", "[bash]", "prints the man page, or bash's completion", RunManual},
      {"doctor", "[OPTIONS]", "prints what is installed and which processor runs what",
       RunDoctor},
  };
  return commands;
}

}  // namespace regrade
