// regrade evaluate --splats: options, and the evaluation of files of splats.
#pragma once

#include <string>
#include <vector>

#include "pipeline/commands/evaluate_frames.h"
#include "pipeline/commands/splat_frames.h"

namespace regrade {

struct SplatsOptions {
  std::vector<std::string> splats;
  SplatInput views;
  std::string background = "auto";
  int size = SplatFrames().size;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("splats", splats,
         {.help = "file of styled splats of any program, to be rendered at the same cameras as "
                  "the splats of --reference; several files, one after the other, as several "
                  "folders of --frames. Motion is exact unless --mode or --protocol says "
                  "otherwise"});
    bind("cameras", views.cameras,
         {.help =
              "of --splats: a capture whose cameras are in their world, as of `regrade run`; "
              "without it views are placed by measurement. Of --frames with --mode geometry: "
              "a transforms.json with the camera of each frame of --reference"});
    bind("up", views.up, {.help = kUpHelp, .choices = kUps});
    bind("background", background,
         {.help =
              "of --splats: the colour behind them, which files do not have; auto is that of "
              "the folder of regrade that --cameras names, or else black",
          .choices = "auto|black|white"});
    bind("size", size,
         {.unit = "pixels",
          .help = "of --splats: longer side of the frames; cameras of smaller pictures keep "
                  "theirs",
          .min = 16,
          .max = 16384});
  }
};

// Renders the files as frames, with depth and cameras, and evaluates these as EvaluateFrames
// does; with --out the frames are kept in OUT/rendered. `has_mode`: the command line says which
// mode.
void EvaluateSplats(const SplatsOptions& splats, FramesOptions frames,
                    ConsistencyOptions options, bool has_mode, const Arguments& words,
                    Console* console);

}  // namespace regrade
