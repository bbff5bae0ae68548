// The sizes of a style network's rows for nine harmonics a channel, as voxels have them.
#pragma once

#include "stylize/field/network_row.h"

namespace regrade {

inline constexpr int kNetworkSh = NetworkRow{}.sh(), kNetworkInputs = NetworkRow{}.inputs(),
                     kFeatureStride = NetworkRow{}.stride();

}  // namespace regrade
