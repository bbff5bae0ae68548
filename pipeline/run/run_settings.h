// All options of a run over an output folder, stage by stage.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "kernels/field/field_kind.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/object_masks.h"
#include "pipeline/fields/camera_path.h"
#include "pipeline/program/option_binding.h"
#include "pipeline/program/run_options.h"
#include "pipeline/report/requirements.h"
#include "pipeline/run/depth_choice.h"
#include "pipeline/run/match_choice.h"
#include "pipeline/run/residual_choice.h"
#include "reconstruct/colmap/poses_from_photos.h"
#include "reconstruct/fit/fit_options.h"
#include "reconstruct/scene/box_options.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "stylize/image/style_options.h"
#include "stylize/training/train_network.h"

namespace regrade {

struct SceneOptions {
  int photo_size = 800;
  std::string field = "voxels";
  BoxOptions box;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("photo-size", photo_size,
         {.unit = "pixels",
          .help = "longer side of the photos that the field is fitted to, and of frames at "
                  "their places; time grows with its square",
          .min = 64,
          .max = 16384});
    bind("field", field,
         {.help = "what the scene is made of: splats are 3D Gaussians, fitted by MCMC; voxels "
                  "are a Plenoxel field",
          .choices = "voxels|splats"});
    box.Describe(bind);
  }
  const FieldKind& Kind() const { return KindNamed(field); }
};

inline constexpr char kUps[] = "auto|x|-x|y|-y|z|-z",
                      kUpHelp[] =
                          "of a file of splats without --cameras: the direction that is up in "
                          "it; auto decides by the file's surfaces";

// What the program needs to know of a file of splats that is given in place of photos.
struct SplatInput {
  std::string cameras, up = "auto";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("cameras", cameras,
         {.help = "of a file of splats: a capture whose cameras are in its world: photos with "
                  "poses, a COLMAP model, a folder of regrade, or a cameras.json. Without it "
                  "views are placed by measurement"});
    bind("up", up, {.help = kUpHelp, .choices = kUps});
  }
};

struct StyleSource {
  std::vector<std::string> pictures;
  MatchChoice match;
  std::string name;
  double strength = 1;

  // The one that stages work on, the first of several that are matched; empty where there is
  // none.
  std::string picture() const { return pictures.empty() ? "" : pictures[0]; }

  template <typename Bind>
  void Describe(Bind& bind) {
    bind(
        "style", pictures,
        {.help = "a style picture: the scene gets its colours, in the folder styles/NAME; give "
                 "the option once for each style. A LUT (.cube) is applied as it is"});
    match.Describe(bind);
    bind("name", name,
         {.help = "name of the style's folder in styles/; by default that of the picture's "
                  "file"});
    bind("strength", strength,
         {.help = "how much of the style is applied: 0 leaves the scene's colours, 1 takes the "
                  "style's",
          .min = 0,
          .max = 1});
  }
};

struct FilmChoice {
  bool films = true;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("films", films,
         {.help = "makes films, and measures the scene along their path; --no-films does "
                  "neither"});
  }
};

struct RenderOptions {
  double fps = 30;
  double film_seconds = 10;
  int film_size = 1280;
  bool keep_exposure = false;
  std::string vignette = "none";
  PathOptions path;
  FilmChoice films;  // bound by itself: where films are made, stages know nothing of it

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("fps", fps,
         {.unit = "frames/s", .help = "frame rate of the films", .min = 1, .max = 240});
    bind("film-seconds", film_seconds,
         {.unit = "s",
          .help = "length of the film; not of --path views",
          .min = 0.1,
          .max = 3600});
    bind("film-size", film_size,
         {.unit = "pixels",
          .help = "longer side of the film, at most the photos'; not of --path "
                  "views",
          .min = 16,
          .max = 16384});
    bind("keep-exposure", keep_exposure,
         {.help = "renders frames at the photos' viewpoints with the exposure and white "
                  "balance of their photos, where these were undone"});
    bind("vignette", vignette,
         {.help =
              "A,B multiplies the style's films and stills by 1 + A r^2 + B r^4, r from 0 at "
              "the middle to 1 at the corners; none; edit, of `regrade retouch`, takes that of "
              "the edit. What is measured, mixtures and pages have none"});
    path.Describe(bind);
  }
};

struct PageChoice {
  std::string page = "auto";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("page", page,
         {.help = "writes scene.html, the scene of splats and its style to walk through in a "
                  "browser: auto keeps it below 25 MB with the splats that photos show most",
          .choices = "auto|on|off"});
  }
};

// Of the sums of a reproducible run, so that they do not depend on the threads.
inline constexpr int kReproducibleShards = 4;

struct RunSettings {
  ProgramOptions program;
  StartOptions start;
  RunOptions run;
  IngestOptions ingest;
  PoseOptions pose;
  SceneOptions scene;
  SplatInput splat_input;
  FitOptions fit;
  SplatFitOptions splats;
  DepthChoice depth;
  StyleSource style;
  StyleOptions style_2d;
  MaskOptions object;
  TrainNetworkOptions network;
  ResidualChoice residual;
  RenderOptions render;
  ConsistencyOptions consistency;
  PageChoice page;

  // Under the headings of the help.
  void Bind(OptionSet* options);
};

// The options that a field of the settings' kind depends on.
JsonValue OptionsOfFit(const RunSettings& settings);

// What --match cannot go with. Throws Error(kUsage).
void CheckMatch(const RunSettings& settings);

// Throws Error(kUsage), naming both, for options that contradict each other.
void CheckTogether(const RunSettings& settings);

// Is the film measured, on frames along its path?
bool MeasuresFilm(const RunSettings& settings);

// What --require demands. Throws Error(kUsage).
std::vector<Requirement> RequirementsOf(const RunSettings& settings);

}  // namespace regrade
