#include "kernels/base/half.h"
#include "kernels/field/cuda/half_grid.h"
#include "kernels/field/cuda/launch.h"

#if defined(__CUDACC__)
#include <cub/device/device_scan.cuh>
#endif

namespace regrade {

HalfGridView HalfGrid::view(const DeviceGrid& grid) const {
  return {order,          grid.frame,           grid.view().last,
          links.data(),   density_pairs.data(), empty_distance.data(),
          records.data(), grid.background,      grid.near_clip};
}

#if defined(__CUDACC__)

namespace {

constexpr int kBasis = 9, kValues = 32;  // of a record in half precision
constexpr uint8_t kOutside = 255;        // padding of a brick: no cell

__device__ uint32_t HalfDensity(float density) {
  return HalfFromFloat(fminf(density, kMaxHalf));
}

__global__ void OrderByBricks(DeviceGridView grid, BrickOrder order, int32_t* marks,
                              uint32_t* density_pairs, uint8_t* empty_distance) {
  const int64_t i = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (i >= order.size) return;
  const Vec3i n = grid.frame.resolution, at = order.At(static_cast<int32_t>(i));
  const bool in_grid = at.x < n.x && at.y < n.y && at.z < n.z;
  const int64_t vertex = in_grid ? grid.frame.Vertex(at.x, at.y, at.z) : 0;
  marks[i] = in_grid && grid.links[vertex] >= 0;
  empty_distance[i] = in_grid ? grid.empty_distance[vertex] : kOutside;
  density_pairs[i] =
      in_grid ? HalfDensity(grid.dense_density[vertex]) |
                    (at.z + 1 < n.z ? HalfDensity(grid.dense_density[vertex + 1]) << 16 : 0u)
              : 0u;
}

// `links` holds the number of stored vertices before each. One warp per vertex, of 32 values.
__global__ void FillRecords(DeviceGridView grid, BrickOrder order, const int32_t* marks,
                            int32_t* links, uint16_t* records) {
  const int64_t thread = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int64_t i = thread / kValues;
  if (i >= order.size) return;
  const int place = static_cast<int>(thread % kValues), quarter = place / 8, k = place % 8;
  if (marks[i] == 0) {
    if (place == 0) links[i] = -1;
    return;
  }
  const Vec3i at = order.At(static_cast<int32_t>(i));
  const float* from =
      grid.records + grid.links[grid.frame.Vertex(at.x, at.y, at.z)] * grid.stride;
  float value = 0;
  if (quarter < 3)
    value = from[quarter * kBasis + k];
  else if (k < 3)
    value = from[k * kBasis + kBasis - 1];
  records[int64_t{links[i]} * kValues + place] = HalfFromFloat(value);
}

}  // namespace

HalfGrid MakeHalfGrid(const DeviceGrid& grid) {
  HalfGrid half;
  const BrickOrder order(grid.frame.resolution);
  if (grid.basis != kBasis || grid.num_voxels() == 0 || order.size > INT32_MAX) return half;
  half.order = order;
  half.links = DeviceBuffer<int32_t>(order.size, "links by bricks");
  half.density_pairs = DeviceBuffer<uint32_t>(order.size, "densities in half precision");
  half.empty_distance = DeviceBuffer<uint8_t>(order.size, "distances by bricks");
  half.records =
      DeviceBuffer<uint16_t>(grid.num_voxels() * kValues, "voxels in half precision");
  DeviceBuffer<int32_t> marks(order.size, "marks of stored vertices");
  OrderByBricks<<<BlocksFor(order.size), kThreads>>>(
      grid.view(), order, marks.data(), half.density_pairs.data(), half.empty_distance.data());
  CheckLaunch("order_by_bricks");
  size_t scratch_bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, scratch_bytes, marks.data(), half.links.data(),
                                order.size);
  DeviceBuffer<uint8_t> scratch(static_cast<int64_t>(scratch_bytes), "scratch of a scan");
  cub::DeviceScan::ExclusiveSum(scratch.data(), scratch_bytes, marks.data(), half.links.data(),
                                order.size);
  CheckLaunch("scan");
  FillRecords<<<BlocksFor(order.size * kValues), kThreads>>>(
      grid.view(), order, marks.data(), half.links.data(), half.records.data());
  CheckLaunch("fill_records");
  DeviceWait("a field in half precision");
  return half;
}

#else

HalfGrid MakeHalfGrid(const DeviceGrid&) {
  DeviceWait("half_records");
  return {};
}

#endif

}  // namespace regrade
