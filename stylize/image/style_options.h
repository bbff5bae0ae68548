// Options of the 2D method that styles each view.
#pragma once

#include <string>

#include "kernels/base/options.h"

namespace regrade {

// For hints; --method has no `choices`, because three of its values continue after a colon.
inline constexpr char kStyleMethods[] =
    "mkl, gmm, reinhard, pca-kd, onnx:DIR, folder:DIR or command:\"PROGRAM ...\"";

struct StyleOptions {
  std::string method = "mkl";
  bool scene_wide = false;
  int parts = 6;
  double max_slope = 4;
  double height_weight = 0;
  int max_side = 1024;
  double command_limit_s = 600;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("method", method,
         {.help =
              "2D method that styles each view: mkl (mean and covariance of the colours), gmm "
              "(the same for groups of colours), reinhard, pca-kd (networks of 302 kB, "
              "fetched once after a yes), onnx:DIR, folder:DIR (photos that another program "
              "styled), command:\"PROGRAM {input} {style} {output}\" (run for each view); see "
              "stylize/README.md",
          .runs = "command:|onnx:",
          .reads = "folder:"});
    bind("scene-wide", scene_wide,
         {.help =
              "estimates one colour map from all views, instead of one for each view: frames "
              "are more consistent with each other, but a single view's colours are further "
              "from the style's; with mkl, gmm and reinhard"});
    bind("style-parts", parts,
         {.help = "groups of colours of method gmm, fewer where a picture has fewer",
          .min = 1,
          .max = 16,
          .constant = true});
    bind("max-slope", max_slope,
         {.help = "how many times method gmm may magnify a difference of colours at most: "
                  "groups are widened where it would be more, which makes them less distinct",
          .min = 1.5,
          .max = 100,
          .constant = true});
    bind("height-weight", height_weight,
         {.help = "how much the height in the picture counts, beside colour, when method gmm "
                  "chooses groups of the style for a group of the photos, so that a sky takes "
                  "the style's sky: from bottom to top as much as this step of one channel; 0 "
                  "looks at colours alone",
          .min = 0,
          .max = 10,
          .constant = true});
    bind("style-max-side", max_side,
         {.unit = "pixels",
          .help = "longer side at which networks see a picture; memory and time grow "
                  "with its square",
          .min = 64,
          .max = 8192,
          .constant = true});
    bind("style-command-limit", command_limit_s,
         {.unit = "s",
          .help = "longest time that command:... may take for one view",
          .min = 0.1,
          .max = 86400,
          .constant = true});
  }
};

enum class StyleMethodKind {
  kMkl,
  kGmm,
  kReinhard,
  kNetwork,  // fetched by the program
  kOnnx,
  kFolder,
  kCommand
};

// Reads networks or pictures from the disk.
inline bool ReadsFiles(StyleMethodKind kind) {
  return kind == StyleMethodKind::kNetwork || kind == StyleMethodKind::kOnnx ||
         kind == StyleMethodKind::kFolder;
}
// Maps colours alone, whatever their place in the picture.
inline bool MapsColors(StyleMethodKind kind) {
  return !ReadsFiles(kind) && kind != StyleMethodKind::kCommand;
}

// "onnx:DIR" and the like: the kind, its name before the colon, and what follows that.
struct StyleMethod {
  StyleMethodKind kind = StyleMethodKind::kMkl;
  std::string name;
  std::string argument;
};

// Throws Error(kUsage) that lists the methods for one that does not exist, has no argument
// behind the colon, or does not support --scene-wide.
StyleMethod ParseStyleMethod(const StyleOptions& options);

}  // namespace regrade
