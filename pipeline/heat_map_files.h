// Pictures of the worst pairs, written beside an evaluation's figures.
#pragma once

#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "pipeline/workspace.h"

namespace regrade {

struct HeatMapFile {
  std::string sequence;
  int gap = 0, from = 0, to = 0;
  std::string path;  // relative to the output folder
};

// Writes heatmaps/NAME_gap1_00012.png for the pair with the largest error of each row, see
// ErrorHeatMap; rows whose pairs are all perfect or undefined have none. Maps of an earlier
// evaluation in this folder are removed. Flow and masks of these pairs are computed once more
// (the evaluation keeps none of them).
//
// Errors: as EvaluateConsistency, and kResources from the disk.
std::vector<HeatMapFile> WriteHeatMaps(const Workspace& workspace, const FrameSource& reference,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyOptions& options,
                                       const ConsistencyReport& report);

}  // namespace regrade
