// Writes a synthetic capture: photos and their exact ground truth.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/base/options.h"
#include "kernels/base/progress.h"
#include "kernels/synthetic/synthetic_scene.h"

namespace regrade {

struct SynthOptions {
  std::string scene = "table";
  int views = 24;
  std::string size = "640x480";
  std::string effects;  // comma-separated
  std::string grade;
  bool flow = true;
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind(
        "scene", scene,
        {.help = "a still life on a table, a wall with shelves, surroundings seen in all "
                 "directions (a room or a square), or a street of 300 m for hundreds of photos",
         .choices = kSyntheticSceneNames});
    bind("views", views, {.unit = "photos", .help = "number of photos", .min = 2, .max = 9999});
    bind("size", size, {.unit = "pixels", .help = "WIDTHxHEIGHT of a photo"});
    bind(
        "effects", effects,
        {.help =
             "effects to simulate, comma-separated: exposure, noise, highlights, masks (of one "
             "object, some wrong), poses (given with tracks, with errors of 0.3 degrees and "
             "0.5 % "
             "of the cameras' extent), mixed-cameras (two cameras, three sizes, portrait and "
             "landscape), and one lens: distortion (mild), barrel (k1 = -0.2) or fisheye"});
    bind(
        "grade", grade,
        {.help = "writes the photos as graded, too, to truth/graded: by one map of colours, by "
                 "the place in the scene, by exchanging two colours of one object, or by a "
                 "vignette over the first",
         .choices = "|global|local|object|vignette"});
    bind("flow", flow,
         {.help =
              "writes the motion between photos 1 and 5 apart, and what both see: up to eight "
              "files for each photo"});
    bind("seed", seed, {.help = "seed of textures, exposures and noise"});
  }
};

// The gaps of the published protocols, and of --gaps' default.
inline constexpr int kSynthGaps[] = {1, 5};

// Writes
//   OUT/images/00000.png ...              8-bit sRGB photos
//   OUT/truth/transforms.json             cameras; file paths relative to OUT/truth
//   OUT/truth/depth/00000.npy             [H, W] float32, z along the optical axis, world units
//   OUT/truth/flow/00000_00001.flo        motion of view i to view j, pixels, for views
//                                         kSynthGaps apart, in both directions; with `flow`
//   OUT/truth/visible/00000_00001.png     255 where view j sees the same point; with `flow`
//   with `masks`: OUT/masks/00000.png, some of them wrong, and correct ones in OUT/truth/masks/
//   with `poses`: OUT/sparse/0/, a COLMAP model with pose errors (synth_model.h)
//   with `grade`: OUT/truth/graded/00000.png, what the true grade makes of each photo
//   OUT/truth/effects.json                the options and the parameters of the effects
// Effects do not change the scene. The same options give the same bytes, for any number of
// threads. Reports progress once per view.
//
// Errors: kUsage for a scene, size or effect that does not exist; kResources from the disk.
void WriteSyntheticCapture(const std::string& out, const SynthOptions& options,
                           const ProgressFunction& progress = {});

}  // namespace regrade
