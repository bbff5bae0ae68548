// What regrade_gpu can do on a machine with nothing but a CUDA driver.
#pragma once

#include <string>

#include "kernels/base/options.h"
#include "kernels/field/device/device_grid.h"
#include "pipeline/files/json_file.h"
#include "pipeline/packed_capture.h"
#include "reconstruct/fit_options.h"
#include "stylize/train_network.h"

namespace regrade {

struct FitPackedOptions {
  std::string capture;  // packed
  std::string field;    // .npz to write; empty: none
  std::string device = "cuda";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("capture", capture, {.help = "a file of `regrade pack`"});
    bind("field", field, {.help = "the .npz file that the field is written to"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "cpu|cuda"});
  }
};

struct StylePackedOptions {
  std::string capture;  // packed with a style
  std::string field;    // .npz
  std::string frames;   // folder for pictures; empty: none
  std::string device = "cuda";

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("capture", capture, {.help = "a file of `regrade pack --style`"});
    bind("field", field, {.help = "the .npz file that `regrade_gpu fit --field` wrote"});
    bind("frames", frames,
         {.help = "a folder for .ppm pictures of the held-out views before and after"});
    bind("device", device, {.help = "where arithmetic runs", .choices = "cpu|cuda"});
  }
};

// Milliseconds of a held-out view's kernel, rays on the device already: the median of all.
double RenderMilliseconds(const DeviceGrid& grid, const PackedCapture& capture,
                          const MarchOptions& march, float opacity_step = 0);
// The same for a row of settings of the march and of opacity_step: milliseconds, and the error
// against the first in dB.
JsonValue RenderPrices(const DeviceGrid& grid, const PackedCapture& capture, float step);

// MKL on each view, then the network; prints one line of JSON: times of the parts, what was
// learned, device memory beyond the field.
void StylePacked(const StylePackedOptions& settings, const TrainNetworkOptions& options);

// Prints one line of JSON: times, counts, PSNR and SSIM of the held-out views, milliseconds a
// rendered view.
void FitPacked(const FitPackedOptions& settings, const FitOptions& options);

}  // namespace regrade
