// The consistency of sequences by forward warping: every pair, and one row for each sequence
// and gap.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/frame_source.h"
#include "kernels/base/progress.h"

namespace regrade {

inline constexpr char kWarpedMode[] = "stylegaussian";

// Compares the pairs of EvaluateConsistency in mode kWarpedMode by both readings of
// warped_error.h; the report has `warped` and `warped_pairs` and no other rows. Flow is
// computed by options.flow, of the unstyled frames and, padded, of each sequence. With
// files:DIR that of a sequence is in DIR/NAME, of frames' size, and of the reference in DIR
// itself; a sequence without such a folder has no published reading.
//
// Errors: those of EvaluateConsistency, of flow and of options.lpips' network. Progress counts
// pairs.
ConsistencyReport EvaluateWarped(const FrameSource& reference,
                                 const std::vector<NamedFrameSource>& sequences,
                                 const ConsistencyOptions& options,
                                 const ProgressFunction& progress = {});

}  // namespace regrade
