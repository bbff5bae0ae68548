// How long each stage of a run takes, before it begins: from sizes and rates that were measured
// on two cores. Rough: other machines differ by a factor of two, and so do captures.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "kernels/device/backend.h"
#include "kernels/scene/capture.h"
#include "pipeline/run/run_settings.h"

namespace regrade {

// What the time depends on. Before poses are known one photo stands for all.
struct CaptureSize {
  int64_t photos = 0;
  int width = 4032, height = 3024;  // of the files, pixels
  bool placed = false;              // poses are given; else COLMAP finds them
  bool lacks_points = false;        // COLMAP finds points for given poses
};

CaptureSize SizeOfCapture(const Capture& capture);

// Photos that are fitted, and their pixels at working size.
int64_t PhotosToFit(const RunSettings& settings, const CaptureSize& size);
int64_t PixelsToFit(const RunSettings& settings, const CaptureSize& size);

struct StageEstimate {
  std::string stage;
  double seconds = 0;
  uint64_t memory = 0;  // bytes at the peak; 0 if not planned
};

// Of all stages but those that are no stage of a run, in the order of a run; each style takes
// the stages from "style_2d" on. The box is taken for a cube, the upper bound.
std::vector<StageEstimate> EstimateStages(const RunSettings& settings, const CaptureSize& size,
                                          Backend backend, int threads);

// The factor from estimated to measured seconds of this machine, of the stages in both, within
// [1/4, 4]; 1 where there are none.
double MeasuredPace(const std::vector<StageEstimate>& estimates,
                    const std::vector<StageEstimate>& measured);

// Of the stages from `first` to `last`.
double SecondsOf(const std::vector<StageEstimate>& estimates, const std::string& first,
                 const std::string& last);

}  // namespace regrade
