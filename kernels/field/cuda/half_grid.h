// What frames of a field read on a CUDA device at interactive rates: colours and densities in
// half precision, half the bytes, and everything ordered by bricks, so that what a ray passes
// lies together whichever way it runs. It stands beside the DeviceGrid that it was made from.
#pragma once

#include "kernels/field/cuda/brick_order.h"
#include "kernels/field/cuda/device_grid.h"

namespace regrade {

// What kernels see.
struct HalfGridView {
  BrickOrder order;
  GridFrame frame;
  Vec3f last{};  // the frame's resolution less 1
  const int32_t* links = nullptr;
  const uint32_t* density_pairs = nullptr;
  const uint8_t* empty_distance = nullptr;
  const uint16_t* records = nullptr;
  Vec3f background{};
  float near_clip = 0;
};

// Only of fields of degree 2; of others it stays empty, their records are small already.
struct HalfGrid {
  BrickOrder order;
  DeviceBuffer<int32_t> links;           // [order.size]: records, or -1
  DeviceBuffer<uint8_t> empty_distance;  // [order.size]
  // [order.size]: the density of a vertex in the low half, of its neighbour along z in the high
  // one; at most 65504 a world unit.
  DeviceBuffer<uint32_t> density_pairs;
  // [N, 4, 8]: the first eight coefficients of each channel, then the ninth of all three.
  // Values beyond 65504 would become infinite; colours never are.
  DeviceBuffer<uint16_t> records;

  bool empty() const { return records.empty(); }
  HalfGridView view(const DeviceGrid& grid) const;
};

HalfGrid MakeHalfGrid(const DeviceGrid& grid);

}  // namespace regrade
