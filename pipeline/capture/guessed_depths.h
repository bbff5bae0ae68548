// Depths that a network guesses from single photos, as points of a fit.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/onnx/onnx_model.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/working_views.h"
#include "reconstruct/scene/point_observations.h"

namespace regrade {

// [H, W, 1] of a photo: what AlignGuess takes. `network`: see AddGuessedDepths. Throws
// Error(kExternalProgram).
Image GuessDepth(const OnnxModel& network, const Image& photo);

struct KnownDepth {
  double x = 0, y = 0;  // pixels of the guess
  double depth = 0;     // z in camera coordinates
};

struct AlignedGuess {
  Image z;           // [H, W, 1] in the unit of the known depths; 0 where the guess is no depth
  double error = 0;  // relative, of one standard deviation
};

// EQ(guessed-depth): networks guess depth, or its inverse, up to a scale and a shift of each
// photo. a, b minimize sum_i h((a g_i + b) z_i^s - 1) over the photo's known depths z_i, h(e) =
// r^2 / (1 + r^2) with r = e / 0.05 (Geman and McClure's), from where Huber's has its minimum;
// s is 1 for a guess of inverse depth and -1 for one of depth, whichever leaves less. Empty
// where fewer than 20 depths are known, where an error of more than 0.15 is left, or where the
// guess leaves more than half of what b alone does. Beyond twice the known depths, and before
// half of them, a guess is none. `guess` is [H, W, 1].
std::optional<AlignedGuess> AlignGuess(const Image& guess,
                                       const std::vector<KnownDepth>& known);

// Adds to the points of each of the views `of`, in the field's frame, one for each square cell
// of a 32nd of the photo's longer side without a point in or beside it: open places of a few
// photos, and walls without texture. `network`: an ONNX file that takes [1, 3, H, W], colours
// less ImageNet's mean over its deviation, sides multiples of 14 and at most 518, and gives [H,
// W], as the relative networks of Depth Anything do. Photos whose points disagree with the
// guess are left out by name. Throws Error(kExternalProgram) for a network that is none.
void AddGuessedDepths(const std::string& network, const WorkingViews& views,
                      const std::vector<int>& of, const ProgressFunction& progress,
                      std::vector<std::vector<SeenPoint>>* seen,
                      std::vector<std::string>* notes);

}  // namespace regrade
