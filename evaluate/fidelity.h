// Fidelity of a styled sequence to its style; temporal consistency alone would rank a grey
// video best.
#pragma once

#include <functional>
#include <vector>

#include "evaluate/edge_map.h"
#include "evaluate/fidelity_row.h"
#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"

namespace regrade {

// References for the metrics of a sequence; each may be empty (null, count 0).
struct FidelityTargets {
  FrameSource views_2d;          // the 2D method's version of each frame
  FrameSource transmittance;     // one channel: pixels above 0.5 show no scene and are excluded
                                 // from psnr_to_2d_db
  const Image* style = nullptr;  // the style picture
  std::function<double(const Image&, const Image&)> perceptual;  // see PairNetwork::Distance
  FrameSource unstyled = {};                                     // each frame before styling
  bool only_psnr = false;                                        // measures nothing else
  EdgeMapFunction edges = {};
};

// One row for each sequence, in one pass: a frame of `targets` is read once for all of them,
// and what is measured of the 2D method's frame is not measured again of a sequence that has
// it. Errors (kInput): counts or sizes that differ. A few frames of each source are in memory,
// which are read from one thread. Progress counts frames of all sequences.
std::vector<FidelityRow> MeasureFidelities(const std::vector<NamedFrameSource>& sequences,
                                           const FidelityTargets& targets,
                                           const ProgressFunction& progress = {});

FidelityRow MeasureFidelity(const NamedFrameSource& sequence, const FidelityTargets& targets,
                            const ProgressFunction& progress = {});

}  // namespace regrade
