// A synthetic capture on disk: photos as a camera would hand them over, and the exact truth
// beside them.
#pragma once

#include <cstdint>
#include <string>

#include "kernels/base/options.h"
#include "kernels/base/progress.h"

namespace regrade {

struct SynthOptions {
  std::string scene = "table";
  int views = 24;
  std::string size = "640x480";
  std::string effects;  // comma-separated
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("scene", scene,
         {.help = "a still life on a table, a wall with shelves, or a room seen all round",
          .choices = "table|wall|room|square"});
    bind("views", views,
         {.unit = "photos", .help = "length of the capture", .min = 2, .max = 9999});
    bind("size", size, {.unit = "pixels", .help = "WIDTHxHEIGHT of a photo"});
    bind(
        "effects", effects,
        {.help =
             "what else to simulate, from exposure, noise, highlights, masks of one object, of "
             "which some are wrong, poses that come with tracks and are 0.3 degrees and 0.5 % "
             "of the spread off, mixed-cameras (three sizes, upright and across, from two "
             "cameras), "
             "and a lens of distortion (mild), barrel (k1 = -0.2) or "
             "fisheye; what is not named costs nothing"});
    bind("seed", seed, {.help = "draws the paint, the exposures and the noise"});
  }
};

// Writes
//   OUT/images/00000.png ...              8-bit sRGB photos
//   OUT/truth/transforms.json             cameras; file paths relative to OUT/truth
//   OUT/truth/depth/00000.npy             [H, W] float32, z along the optical axis, world units
//   OUT/truth/flow/00000_00001.flo        motion of view i to view i + 1, pixels
//   OUT/truth/visible/00000_00001.png     255 where view i + 1 sees the same point
//   with `masks`: OUT/masks/00000.png, some of them wrong, and the right OUT/truth/masks/
//   with `poses`: OUT/sparse/0/, a COLMAP model whose poses are off (synth_model.h)
//   OUT/truth/effects.json                the options, and the parameters of what was simulated
// The scene itself does not change with the effects. Same options, same bytes, for any number
// of threads. Reports progress once a view.
//
// Errors: kUsage for a scene, size or effect that does not exist; kResources from the disk.
void WriteSyntheticCapture(const std::string& out, const SynthOptions& options,
                           const ProgressFunction& progress = {});

}  // namespace regrade
