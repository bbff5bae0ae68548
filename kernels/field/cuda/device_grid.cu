// Upload and download of a grid, and the arrays derived from links and records.
#include <algorithm>

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/gradient_view.h"
#include "kernels/field/cuda/launch.h"

namespace regrade {

DeviceGridView DeviceGrid::view() const {
  return {
      frame,
      links.data(),
      dense_density.data(),
      empty_distance.data(),
      vertex_of_voxel.data(),
      records.data(),
      stride(),
      static_cast<int32_t>(num_voxels()),
      background,
      near_clip,
      {static_cast<float>(frame.resolution.x - 1), static_cast<float>(frame.resolution.y - 1),
       static_cast<float>(frame.resolution.z - 1)},
      spheres.view()};
}

DeviceGrid UploadGrid(const FastGrid& grid, bool fitting, const Buffer<float>& second_moment,
                      bool exact_sums, const Buffer<float>& sphere_moment) {
  DeviceGrid device;
  device.frame = grid.frame;
  device.basis = grid.basis;
  device.background = grid.background;
  device.near_clip = grid.near_clip;
  device.links = DeviceBuffer<int32_t>::Of(grid.links, "links");
  device.fitting = fitting;
  device.exact_sums = exact_sums;
  const int64_t n = grid.num_voxels(), row = device.lanes() * int64_t{sizeof(float)};
  device.records = DeviceBuffer<float>(n * device.stride(), "voxels");
  device.records.Zero();
  const int64_t pitch = device.stride() * int64_t{sizeof(float)};
  DeviceCopyRows(device.records.data(), pitch, grid.records.data(), row, row, n);
  if (fitting && second_moment.size() == grid.records.size())
    DeviceCopyRows(device.second_moment(), pitch, second_moment.data(), row, row, n);
  RefreshDerived(&device, grid.num_voxels());
  device.spheres = UploadSpheres(grid.spheres, fitting, sphere_moment, exact_sums);
  return device;
}

namespace {

// The lanes of all voxels from `from` on, one after the other: gathered on the device piece by
// piece, since the host would copy each row by itself.
Buffer<float> DownloadRows(const DeviceGrid& device, const float* from) {
  constexpr int64_t kPieceBytes = 64 << 20;
  const int64_t n = device.num_voxels(), lanes = device.lanes(), stride = device.stride();
  const int64_t row = lanes * int64_t{sizeof(float)}, piece = kPieceBytes / row;
  Buffer<float> rows(n * lanes);
  DeviceBuffer<float> gathered(std::min(n, piece) * lanes, "voxels on their way to the host");
  for (int64_t first = 0; first < n; first += piece) {
    const int64_t count = std::min(piece, n - first);
    DeviceCopyRows(gathered.data(), row, from + first * stride, stride * int64_t{sizeof(float)},
                   row, count);
    gathered.CopyOut(rows.data() + first * lanes, count * lanes);
  }
  return rows;
}

}  // namespace

Buffer<float> DownloadSecondMoment(const DeviceGrid& device) {
  return DownloadRows(device, device.second_moment());
}

Buffer<float> DownloadGradient(const DeviceGrid& device) {
  if (!device.exact_sums) return DownloadRows(device, device.gradient());
  const int64_t values = device.num_voxels() * device.lanes(),
                row = device.lanes() * int64_t{sizeof(int64_t)};
  Buffer<int64_t> units(values);
  DeviceCopyRows(units.data(), row, device.gradient(), device.stride() * int64_t{sizeof(float)},
                 row, device.num_voxels());
  Buffer<float> gradient(values);
  for (int64_t i = 0; i < values; ++i)
    gradient[i] = static_cast<float>(static_cast<double>(units[i]) * kExactUnit);
  return gradient;
}

FastGrid DownloadGrid(const DeviceGrid& device) {
  FastGrid grid;
  grid.frame = device.frame;
  grid.basis = device.basis;
  grid.background = device.background;
  grid.near_clip = device.near_clip;
  grid.links = device.links.ToHost();
  grid.records = DownloadRows(device, device.records.data());
  RefreshDerived(&grid);
  grid.spheres = DownloadSpheres(device.spheres);
  return grid;
}

#if defined(__CUDACC__)

namespace {

constexpr uint8_t kFar = 16;  // sufficient: a warp advances 32 samples anyway

__global__ void ScatterVoxels(DeviceGridView grid, int density_lane, int64_t vertices,
                              int32_t* vertex_of_voxel, uint8_t* distance) {
  const int64_t vertex = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (vertex >= vertices) return;
  const int32_t link = grid.links[vertex];
  grid.dense_density[vertex] =
      link < 0 ? 0.0f : grid.records[link * grid.stride + density_lane];
  if (link >= 0) vertex_of_voxel[link] = static_cast<int32_t>(vertex);
  // True if a corner of the cell above this vertex is stored.
  const Vec3i n = grid.frame.resolution;
  const int at[3] = {static_cast<int>(vertex / (static_cast<int64_t>(n.y) * n.z)),
                     static_cast<int>(vertex / n.z % n.y), static_cast<int>(vertex % n.z)};
  bool stored = false;
  for (int corner = 0; corner < 8; ++corner) {
    const int x = at[0] + (corner >> 2 & 1), y = at[1] + (corner >> 1 & 1),
              z = at[2] + (corner & 1);
    if (x < n.x && y < n.y && z < n.z)
      stored = stored || grid.links[grid.frame.Vertex(x, y, z)] >= 0;
  }
  distance[vertex] = stored ? 0 : kFar;
}

// One axis of the Chebyshev distance: the minimum of max(distance, steps along the axis).
__global__ void SpreadAlongAxis(Vec3i n, int axis, int64_t vertices, const uint8_t* from,
                                uint8_t* to) {
  const int64_t vertex = blockIdx.x * static_cast<int64_t>(blockDim.x) + threadIdx.x;
  if (vertex >= vertices) return;
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  const int at = static_cast<int>(vertex / strides[axis] % n[axis]);
  int best = from[vertex];
  for (int r = 1; r < best; ++r) {
    if (at - r >= 0)
      best = min(best, max(static_cast<int>(from[vertex - r * strides[axis]]), r));
    if (at + r < n[axis])
      best = min(best, max(static_cast<int>(from[vertex + r * strides[axis]]), r));
  }
  to[vertex] = static_cast<uint8_t>(best);
}

}  // namespace

void RefreshDerived(DeviceGrid* grid, int64_t num_voxels) {
  const int64_t vertices = grid->frame.NumVertices();
  grid->vertex_of_voxel = DeviceBuffer<int32_t>(num_voxels, "vertices of voxels");
  grid->dense_density = DeviceBuffer<float>(vertices, "dense densities");
  grid->empty_distance = DeviceBuffer<uint8_t>(vertices, "distances through empty space");
  DeviceBuffer<uint8_t> other(vertices, "distances through empty space");
  ScatterVoxels<<<BlocksFor(vertices), kThreads>>>(grid->view(), DensityLane(grid->basis),
                                                   vertices, grid->vertex_of_voxel.data(),
                                                   grid->empty_distance.data());
  CheckLaunch("scatter_voxels");
  for (int axis = 0; axis < 3; ++axis) {
    SpreadAlongAxis<<<BlocksFor(vertices), kThreads>>>(
        grid->frame.resolution, axis, vertices, grid->empty_distance.data(), other.data());
    CheckLaunch("spread_along_axis");
    std::swap(grid->empty_distance, other);
  }
  DeviceWait("distances through empty space");
}

#else

void RefreshDerived(DeviceGrid*, int64_t) { DeviceWait("distances through empty space"); }

#endif

}  // namespace regrade
