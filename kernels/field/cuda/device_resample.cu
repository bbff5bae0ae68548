// Pruning and resampling on the device, by the rule of Resample in
// reconstruct/fit/resample_grid.h.
#include <algorithm>

#include "kernels/base/error.h"
#include "kernels/field/cuda/brick_order.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/launch.h"
#include "kernels/field/trilinear.h"

#if defined(__CUDACC__)
#include <cub/device/device_scan.cuh>
#endif

namespace regrade {

#if defined(__CUDACC__)

namespace {

__global__ void MarkHeavy(DeviceGridView grid, const float* weights, float threshold,
                          uint8_t* keep) {
  const int64_t voxel = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (voxel < grid.num_voxels && weights[voxel] >= threshold)
    keep[grid.vertex_of_voxel[voxel]] = 1;
}

__global__ void GrowAlongAxis(Vec3i n, int axis, int64_t vertices, const uint8_t* from,
                              uint8_t* to) {
  const int64_t vertex = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (vertex >= vertices) return;
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  const int at = static_cast<int>(vertex / strides[axis] % n[axis]);
  to[vertex] = from[vertex] | (at > 0 ? from[vertex - strides[axis]] : 0) |
               (at + 1 < n[axis] ? from[vertex + strides[axis]] : 0);
}

// Position of a vertex of `frame` among the vertices of `old`.
__device__ Vec3f OldPosition(const GridFrame& frame, const GridFrame& old, const Vec3i& at) {
  const Vec3f scale = frame.Scale(), offset = frame.Offset();
  const Vec3f old_scale = old.Scale(), old_offset = old.Offset();
  Vec3f p;
  for (int a = 0; a < 3; ++a) {
    const float world = (static_cast<float>(at[a]) - offset[a]) / scale[a];
    p[a] = fminf(fmaxf(world * old_scale[a] + old_offset[a], 0.0f),
                 static_cast<float>(old.resolution[a] - 1));
  }
  return p;
}

// The vertex at a place of the order; false for the padding of a brick.
__device__ bool VertexAt(const GridFrame& frame, const BrickOrder& order, int64_t place,
                         Vec3i* at) {
  if (place >= order.size) return false;
  *at = order.At(static_cast<int32_t>(place));
  return at->x < frame.resolution.x && at->y < frame.resolution.y && at->z < frame.resolution.z;
}

__global__ void MarkKept(GridFrame frame, GridFrame old, BrickOrder order, const uint8_t* keep,
                         int32_t* marks) {
  const int64_t place = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (place >= order.size) return;
  Vec3i at;
  int32_t mark = 0;
  if (VertexAt(frame, order, place, &at)) {
    const Vec3f p = OldPosition(frame, old, at);
    mark = keep[old.Vertex(static_cast<int>(lroundf(p.x)), static_cast<int>(lroundf(p.y)),
                           static_cast<int>(lroundf(p.z)))];
  }
  marks[place] = mark;
}

// `ranks` holds the number of kept vertices before each place, `marks` whether a place is kept.
__global__ void NumberKept(GridFrame frame, BrickOrder order, const int32_t* marks,
                           const int32_t* ranks, int32_t* links) {
  const int64_t place = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  Vec3i at;
  if (VertexAt(frame, order, place, &at))
    links[frame.Vertex(at.x, at.y, at.z)] = marks[place] != 0 ? ranks[place] : -1;
}

template <int kBasis>
__global__ void FillVoxels(GridFrame frame, BrickOrder order, const int32_t* marks,
                           const int32_t* ranks, DeviceGridView old, float* records,
                           int64_t stride) {
  constexpr int kLanes = RecordLanes(kBasis);
  const int64_t thread = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  const int64_t place = thread / kLanes;
  Vec3i at;
  if (!VertexAt(frame, order, place, &at) || marks[place] == 0) return;
  const int value = static_cast<int>(thread % kLanes);
  const Cell<float> cell = LocateCell(old.frame, OldPosition(frame, old.frame, at));
  float sum = 0;
  for (int k = 0; k < 8; ++k) {
    const int32_t link = old.links[CornerVertex(old.frame, cell.vertex, k)];
    if (link >= 0)
      sum += CornerWeight(cell.fraction, k) * old.records[link * old.stride + value];
  }
  records[ranks[place] * stride + value] = sum;
}

}  // namespace

DeviceGrid ResampleOnDevice(const DeviceGrid& grid, const DeviceBuffer<float>& weights,
                            float threshold, const Vec3i& resolution) {
  const int64_t old_vertices = grid.frame.NumVertices();
  DeviceBuffer<uint8_t> keep(old_vertices, "marks of kept vertices");
  DeviceBuffer<uint8_t> grown(old_vertices, "marks of kept vertices");
  keep.Zero();
  MarkHeavy<<<BlocksFor(grid.num_voxels()), kThreads>>>(grid.view(), weights.data(), threshold,
                                                        keep.data());
  CheckLaunch("mark_heavy");
  for (int axis = 0; axis < 3; ++axis) {
    GrowAlongAxis<<<BlocksFor(old_vertices), kThreads>>>(
        grid.frame.resolution, axis, old_vertices, keep.data(), grown.data());
    CheckLaunch("grow_along_axis");
    std::swap(keep, grown);
  }
  DeviceGrid result;
  result.frame = grid.frame;
  result.frame.resolution = resolution;
  result.basis = grid.basis;
  result.background = grid.background;
  result.near_clip = grid.near_clip;
  // Voxels are numbered by bricks, so that neighbours are close in memory.
  const BrickOrder order(resolution);
  REGRADE_CHECK(order.size <= INT32_MAX);
  DeviceBuffer<int32_t> marks(order.size, "marks of new voxels");
  MarkKept<<<BlocksFor(order.size), kThreads>>>(result.frame, grid.frame, order, keep.data(),
                                                marks.data());
  CheckLaunch("mark_kept");
  DeviceBuffer<int32_t> ranks(order.size, "numbers of new voxels");
  size_t scratch_bytes = 0;
  cub::DeviceScan::ExclusiveSum(nullptr, scratch_bytes, marks.data(), ranks.data(), order.size);
  DeviceBuffer<uint8_t> scratch(static_cast<int64_t>(scratch_bytes), "scratch of a scan");
  cub::DeviceScan::ExclusiveSum(scratch.data(), scratch_bytes, marks.data(), ranks.data(),
                                order.size);
  CheckLaunch("scan");
  int32_t last_rank = 0, last_mark = 0;
  DeviceCopyOut(&last_rank, ranks.data() + order.size - 1, sizeof last_rank);
  DeviceCopyOut(&last_mark, marks.data() + order.size - 1, sizeof last_mark);
  const int64_t count = int64_t{last_rank} + last_mark;
  if (count == 0) return result;
  result.links = DeviceBuffer<int32_t>(result.frame.NumVertices(), "links");
  NumberKept<<<BlocksFor(order.size), kThreads>>>(result.frame, order, marks.data(),
                                                  ranks.data(), result.links.data());
  CheckLaunch("number_kept");
  result.fitting = grid.fitting;
  result.exact_sums = grid.exact_sums;
  result.records = DeviceBuffer<float>(count * result.stride(), "voxels");
  if (result.fitting) result.records.Zero();
  ByBasis(grid.basis, [&](auto basis) {
    FillVoxels<basis.value><<<BlocksFor(order.size * result.lanes()), kThreads>>>(
        result.frame, order, marks.data(), ranks.data(), grid.view(), result.records.data(),
        result.stride());
  });
  CheckLaunch("fill_voxels");
  RefreshDerived(&result, count);
  return result;
}

#else

DeviceGrid ResampleOnDevice(const DeviceGrid&, const DeviceBuffer<float>&, float,
                            const Vec3i&) {
  DeviceWait("resample");
  return {};
}

#endif

}  // namespace regrade
