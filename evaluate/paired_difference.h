// The difference of sequences over the same pairs of frames.
#pragma once

#include <string>

#include "evaluate/consistency_report.h"

namespace regrade {

// Gives every row but those of `sequence` its difference to that sequence at the same gap: of
// TC-PSNR in dB, or of the corrected RMSE in mode stylegaussian. Pairs of frames that are
// undefined or infinite in either sequence are in no difference.
void AddDifferences(const std::string& sequence, ConsistencyReport* report);

}  // namespace regrade
