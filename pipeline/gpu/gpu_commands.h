// What regrade_gpu can do on a machine without COLMAP, OpenCV and picture formats.
#pragma once

#include <string>

#include "kernels/base/options.h"
#include "kernels/field/cuda/device_rays.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/capture/packed_capture.h"
#include "pipeline/files/json_file.h"
#include "pipeline/program/option_binding.h"
#include "pipeline/program/run_options.h"
#include "reconstruct/fit/fit_options.h"
#include "reconstruct/splats/splat_fit_options.h"
#include "stylize/training/train_network.h"

namespace regrade {

struct FitPackedOptions {
  std::string capture;  // packed
  std::string out;      // .npz to write; empty: none
  std::string frames;   // folder for pictures; empty: none
  std::string preset = "standard";
  std::string paper_config = "auto";
  std::string checkpoint;
  double stop_after = 0;
  std::string device = "cuda";
  uint64_t seed = 0;
  double max_memory_gb = 0;   // see RunOptions
  bool reproducible = false;  // likewise

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("preset", preset,
         {.help = "how much time the fit may take, as of `regrade run`",
          .choices = "draft|standard|paper|best"});
    bind("paper-config", paper_config,
         {.help = kPaperConfigHelp, .choices = "auto|syn|llff|tnt|custom"});
    bind("capture", capture, {.help = "a file of `regrade pack`"});
    bind(
        "checkpoint", checkpoint,
        {.help = "a file that an unfinished fit is kept in; the same command again continues"});
    bind("stop-after", stop_after,
         {.unit = "s",
          .help = "stops there, with the checkpoint written; 0: never",
          .min = 0,
          .max = 1e6});
    bind("out", out, {.help = "the .npz file that the field is written to"});
    bind("frames", frames, {.help = "a folder for .ppm pictures of the held-out views"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "cpu|cuda"});
    bind("seed", seed, {.help = "seed of all random numbers"});
    bind("max-memory", max_memory_gb,
         {.unit = "GB", .help = kMaxMemoryHelp, .min = 0, .max = 1e6});
    bind("reproducible", reproducible, {.help = "two fits give the same bytes"});
  }
};

struct FitSplatsOptions {
  std::string capture;  // packed
  std::string out;      // .npz to write; empty: none
  std::string frames;   // folder for pictures; empty: none
  std::string preset = "standard";
  std::string device = "cuda";
  uint64_t seed = 0;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("preset", preset,
         {.help = "steps and number of splats, as of `regrade run`",
          .choices = "draft|standard|best"});
    bind("capture", capture, {.help = "a file of `regrade pack`"});
    bind("out", out, {.help = "the .npz file that the field is written to"});
    bind("frames", frames, {.help = "a folder for .ppm pictures of the held-out views"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "cpu|cuda"});
    bind("seed", seed, {.help = "seed of all random numbers"});
  }
};

struct StylePackedOptions {
  std::string capture;  // packed with a style
  std::string field;    // .npz
  std::string styled;   // .npz to write; empty: none
  std::string frames;   // folder for pictures; empty: none
  std::string network;  // likewise
  std::string device = "cuda";
  uint64_t seed = 0;
  bool reproducible = false;  // see RunOptions

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("capture", capture, {.help = "a file of `regrade pack --style`"});
    bind("field", field, {.help = "the .npz file that `regrade_gpu fit|splats --out` wrote"});
    bind("styled", styled, {.help = "the .npz file that the restyled field is written to"});
    bind("frames", frames,
         {.help = "a folder for .ppm pictures of the held-out views before and after"});
    bind("network", network, {.help = "the .npz file that the network is written to"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "cpu|cuda"});
    bind("seed", seed, {.help = "seed of all random numbers"});
    bind("reproducible", reproducible, {.help = "two trainings give the same bytes"});
  }
};

struct RenderPackedOptions {
  std::string capture;  // packed
  std::string field;    // .npz
  std::string frames;   // folder for pictures; empty: none
  bool compare = false;
  int path_frames = 24;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("capture", capture, {.help = "a file of `regrade pack`, for its held-out cameras"});
    bind("field", field, {.help = "an .npz file with svox2's layout"});
    bind("frames", frames,
         {.help = "a folder for .ppm pictures of the held-out views; with --compare, of the "
                  "film by the exact and by the fast renderer"});
    bind("compare", compare,
         {.help = "compares the film's fast renderer and its variants with the exact one, on "
                  "all training views and frames of a film"});
    bind("path-frames", path_frames,
         {.unit = "frames", .help = "length of the film to compare", .min = 2, .max = 10000});
  }
};

// Milliseconds from a held-out view's camera (through a lens without distortion) to its pixels
// on the device: the median of all.
double RenderMilliseconds(const DeviceGrid& grid, const PackedCapture& capture,
                          const MarchOptions& march, const FastFrames& fast = {});
// The same for a row of settings of the march and of faster frames: milliseconds, and the error
// against the first in dB, PSNR, SSIM and detail kept to the photos.
JsonValue RenderCosts(const DeviceGrid& grid, const PackedCapture& capture, float step);
// Of a field of any kind, which is uploaded for that; splats have one row.
JsonValue RenderCosts(const RadianceField& field, const PackedCapture& capture);

// A view as splats show it: through a lens without distortion, in the world. The photo is NaN
// where it does not reach.
PackedView PinholeView(PackedView view);
// Of a field's capture: pinholes, if it has splats.
PackedCapture ReadCaptureFor(const RadianceField& field, const std::string& path);

// The held-out views, exact, as pictures NAME_0.ppm, NAME_1.ppm, ...
void RenderHeldOut(const FieldRenderer& renderer, const PackedCapture& capture,
                   const std::string& folder, const std::string& name);

// Writes an 8-bit picture. Throws Error(kResources).
void WritePpm(const std::string& path, const Image& image);

// The film's fast renderer and its variants against the exact one (see fast_variants.cc).
JsonValue CompareRenderers(const DeviceGrid& grid, const PackedCapture& capture, float step,
                           const RenderPackedOptions& settings);

// Prints one line of JSON: what frames of a field cost at which accuracy.
void RenderPacked(const RenderPackedOptions& settings);

// MKL on each view, then the network; prints one line of JSON: times of the parts, what was
// learned, device memory beyond the field.
void StylePacked(const StylePackedOptions& settings, const TrainNetworkOptions& options);

// Prints one line of JSON: times, counts, PSNR, SSIM and fine detail of the held-out views,
// milliseconds a rendered view. `curve_heldout` has [seconds, PSNR, SSIM, detail kept]; seconds
// are of this call. The grid is lowered to memory as `regrade run` does. `bound` has `settings`
// and `fit`, which --preset paper sets by the capture. Throws Interrupted after --stop-after.
void FitPacked(const FitPackedOptions& settings, const FitOptions& fit, OptionSet* bound);

// Fits splats; prints one line of JSON like FitPacked's. Photos with a lens are undistorted,
// and so are those that are measured.
void FitSplatsPacked(const FitSplatsOptions& settings, const SplatFitOptions& fit);

}  // namespace regrade
