// What the fit's options become for a capture: one rule for all captures.
#pragma once

#include <cstdint>
#include <string>

#include "reconstruct/fit/fit_options.h"

namespace regrade {

struct FitConditions {
  bool device_coordinates = false;  // a forward-facing capture; see kernels/scene/ndc.h
  bool on_card = false;
  int64_t pixels = 0;             // of the photos that are fitted
  bool known_background = false;  // photos are transparent around the scene
};

// - Rays per step, where they are 0: 4096 on a CPU; on a card as many as make kPasses passes
//   over the photos' pixels in all steps, from 4096 to 14336. Fewer passes leave captures of
//   many photos soft (COSTS.md).
// - Stages of an adaptive field, with fewer_stages: none is finer than half the square root of
//   the pixels. Nine photos of 640 x 480 pixels lose 0.5 dB and .05 of SSIM by cells half as
//   wide (COSTS.md).
// - In device coordinates an adaptive field has its own rates, no loss of free space, at most
//   max_forward_cells, and from 768 cells a side on more total variation with each; where
//   the background is known it has less total variation, for silhouettes determine the
//   densities. Of rates and losses one that is not at its default was asked for, and stays.
// Applied twice with the same conditions, it changes nothing more.
FitOptions AdaptOptions(FitOptions options, const FitConditions& conditions);

// What a user should know of it, or nothing.
std::string NoteOfAdapting(const FitOptions& asked, const FitOptions& adapted);

inline constexpr int kPasses = 16;

}  // namespace regrade
