// A copy of a DeviceGrid for the frames of films: colours and densities in half precision, in
// half the bytes, ordered by bricks, so that a ray in any direction reads nearby memory.
#pragma once

#include "kernels/field/cuda/brick_order.h"
#include "kernels/field/cuda/device_grid.h"

namespace regrade {

// A non-owning view for kernels.
struct HalfGridView {
  BrickOrder order;
  GridFrame frame;
  Vec3f last{};  // the frame's resolution minus 1
  const int32_t* links = nullptr;
  const uint32_t* density_pairs = nullptr;
  const uint8_t* empty_distance = nullptr;
  const uint16_t* records = nullptr;
  Vec3f background{};
  float near_clip = 0;
};

// Only for fields of degree 2; for others it stays empty: records of a lower degree are small.
struct HalfGrid {
  BrickOrder order;
  DeviceBuffer<int32_t> links;           // [order.size]: records, or -1
  DeviceBuffer<uint8_t> empty_distance;  // [order.size]
  // [order.size]: the density of a vertex in the low half, that of its neighbour along z in the
  // high half; at most 65504 per world unit.
  DeviceBuffer<uint32_t> density_pairs;
  // [N, 4, 8]: the first eight coefficients of each channel, then the ninth of all three.
  // Values beyond 65504 would become infinite; colours stay below.
  DeviceBuffer<uint16_t> records;

  bool empty() const { return records.empty(); }
  HalfGridView view(const DeviceGrid& grid) const;
};

HalfGrid MakeHalfGrid(const DeviceGrid& grid);

}  // namespace regrade
