// What regrade_gpu can do on a machine with nothing but a CUDA driver.
#pragma once

#include <string>

#include "kernels/base/options.h"
#include "reconstruct/fit_options.h"

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

// Prints one line of JSON: times, counts, PSNR and SSIM of the held-out views, milliseconds a rendered view.
void FitPacked(const FitPackedOptions& settings, const FitOptions& options);

}  // namespace regrade
