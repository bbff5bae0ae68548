// A row of a style's network in the lanes of a warp. Device code only.
#pragma once

#include <type_traits>

#include "stylize/field/network_row.h"

#if defined(__CUDACC__)

namespace regrade {

// Lane l has the values l and, of 16 harmonics a channel, l + 32.
template <int kBasis>
struct WarpRow {
  static constexpr NetworkRow kRow{kBasis};
  static constexpr int kSh = kRow.sh(), kMass = kRow.mass(), kStride = kRow.stride();
  static constexpr int kParts = kStride / 32;  // values of a lane
};

// Calls launch(std::integral_constant<int, basis>) for the harmonics of a row.
template <typename Launch>
void ByRow(const NetworkRow& row, const Launch& launch) {
  if (row.basis == kMaxBasis)
    launch(std::integral_constant<int, kMaxBasis>());
  else
    launch(std::integral_constant<int, kMaxVoxelBasis>());
}

}  // namespace regrade

#endif
