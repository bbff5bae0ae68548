// Options of `regrade contact-sheet`.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

struct SheetOptions {
  std::string out;
  int views = 3;
  int size = 320;
  int steps = 0;
  bool control_field = false;
  int holdout = 8;
  std::string device = "auto";
  bool dry_run = false;
  bool yes = false;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("out", out, {.help = "the picture to write, a PNG file"});
    bind("views", views,
         {.unit = "photos",
          .help = "photos shown of each style, evenly spaced",
          .min = 1,
          .max = 100});
    bind("size", size,
         {.unit = "pixels",
          .help = "longer side of each picture on the sheet, and of the training pictures; "
                  "time grows with its square",
          .min = 64,
          .max = 4096});
    bind("steps", steps,
         {.unit = "steps",
          .help = "training steps of each network; 0 takes those of its recipe",
          .min = 0,
          .max = 1e6});
    bind(
        "control-field", control_field,
        {.help = "adds a column of the naive way to style a scene: a field fitted to the 2D "
                 "method's pictures of the photos, with the options of the scene's own fit and "
                 "its time"});
    bind("holdout", holdout,
         {.unit = "photos",
          .help = "as in `regrade run`, by default as in the run of DIR",
          .min = 0,
          .max = 1000});
    bind("device", device, {.help = "where networks are trained", .choices = "auto|cpu|cuda"});
    bind("dry-run", dry_run, {.help = "prints what would be done, and does nothing"});
    bind("yes", yes,
         {.help = "answers yes: fetches what --method pca-kd needs, and reads the masks that "
                  "the folder's run.json names outside of it"});
  }
};

}  // namespace regrade
