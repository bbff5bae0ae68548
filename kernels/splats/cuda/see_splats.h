// The splats that a camera sees, on the device. Of a view of basis 0 records have no colours.
#pragma once

#include "kernels/device/device_memory.h"
#include "kernels/splats/cuda/splat_record.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

inline constexpr uint32_t kUnseen = 0xFFFFFFFF;  // after all z

// [splats], by index; records of those that meet a tile.
struct SeenSplats {
  SplatRecord* record;
  int32_t* num_tiles;  // 0: not seen
  uint32_t* z_bits;    // of z as a float, which order as z does; or kUnseen
  int32_t* index;      // 0, 1, 2 ...
};

void SeeSplatsOnDevice(const SplatsView<float>& splats, const SplatCamera& camera,
                       const SplatOptions& options, const TileGrid& grid,
                       const SeenSplats& seen);

}  // namespace regrade
