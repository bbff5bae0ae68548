// Writes heat maps of the pairs with the largest errors.
#pragma once

#include <vector>

#include "evaluate/consistency.h"
#include "pipeline/report/evaluation_metrics.h"
#include "pipeline/workspace/workspace.h"

namespace regrade {

inline constexpr char kHeatMapFolder[] = "heatmaps";

// Makes the folder, and removes maps of an earlier evaluation from it.
void BeginHeatMaps(const Workspace& workspace);

// Writes heatmaps/NAME_gap1_00012.png for each of the report's worst pairs, see ErrorHeatMap.
//
// Errors: those of the frames, and kResources for a full disk.
std::vector<HeatMapFile> WriteHeatMaps(const Workspace& workspace,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const ConsistencyReport& report);

}  // namespace regrade
