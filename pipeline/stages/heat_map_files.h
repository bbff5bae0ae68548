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

// Writes heatmaps/NAME_gap1_00012.png for the pair with the largest error of each row, see
// ErrorHeatMap; rows whose pairs are all perfect or undefined have none. `motion` computes flow
// and masks of these pairs again (the evaluation does not keep them).
//
// Errors: as EvaluateConsistency, and kResources for a full disk.
std::vector<HeatMapFile> WriteHeatMaps(const Workspace& workspace,
                                       const PairMotionFunction& motion,
                                       const std::vector<NamedFrameSource>& sequences,
                                       const std::vector<int>& gaps,
                                       const ConsistencyReport& report);

}  // namespace regrade
