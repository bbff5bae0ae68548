// All options of a run over an output folder, stage by stage.
#pragma once

#include <string>

#include "evaluate/consistency.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/object_masks.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/program/option_binding.h"
#include "pipeline/program/run_options.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/fit/fit_options.h"
#include "stylize/image/style_options.h"
#include "stylize/training/train_network.h"

namespace regrade {

struct SceneOptions {
  int photo_size = 800;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("photo-size", photo_size,
         {.unit = "pixels",
          .help = "longer side of the photos that the field is fitted to, and of rendered "
                  "frames; time grows with its square",
          .min = 64,
          .max = 16384});
  }
};

struct StyleSource {
  std::string picture;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("style", picture, {.help = "the style picture: the scene gets its colours"});
  }
};

struct RenderOptions {
  double fps = 24;
  bool keep_exposure = false;
  bool exact = false;
  PathOptions path;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("fps", fps,
         {.unit = "frames/s", .help = "frame rate of the films", .min = 1, .max = 240});
    bind("keep-exposure", keep_exposure,
         {.help = "renders frames at the photos' viewpoints with the exposure and white "
                  "balance of their photos, where these were undone"});
    bind("exact", exact,
         {.help = "renders the film's frames as exactly as the views; by default a GPU renders "
                  "them in half precision, with one colour for each 1/128 of opacity"});
    path.Describe(bind);
  }
};

struct RunSettings {
  ProgramOptions program;
  StartOptions start;
  RunOptions run;
  IngestOptions ingest;
  PoseOptions pose;
  SceneOptions scene;
  FitOptions fit;
  StyleSource style;
  StyleOptions style_2d;
  MaskOptions object;
  TrainNetworkOptions network;
  RenderOptions render;
  ConsistencyOptions consistency;

  // Under the headings of the help.
  void Bind(OptionSet* options);
};

// Throws Error(kUsage), naming both, for options that contradict each other.
void CheckTogether(const RunSettings& settings);

}  // namespace regrade
