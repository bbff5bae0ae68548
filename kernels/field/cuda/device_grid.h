// The field on a CUDA device, in the layout of packed_grid.h: one record of RecordLanes(basis)
// floats per voxel, and the density also in a dense array, so that a march along a ray reads
// records only for samples that composite.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/field/cuda/device_spheres.h"
#include "kernels/field/packed_grid.h"

namespace regrade {

// A non-owning view for kernels. Shapes as in FastGrid.
struct DeviceGridView {
  GridFrame frame;
  const int32_t* links = nullptr;            // [X, Y, Z]
  float* dense_density = nullptr;            // [X, Y, Z]
  const uint8_t* empty_distance = nullptr;   // [X, Y, Z]
  const int32_t* vertex_of_voxel = nullptr;  // [N]
  float* records = nullptr;                  // [N, stride], the first `lanes` of each are used
  int64_t stride = 0;                        // floats from a record to the next
  int32_t num_voxels = 0;
  Vec3f background{};
  float near_clip = 0;
  Vec3f last{};  // the frame's resolution minus 1
  DeviceSpheresView spheres;

  // Points number the voxels, and from the next multiple of 32 the texels of the background.
  HD int32_t first_texel() const { return (num_voxels + 31) / 32 * 32; }
};

struct DeviceGrid {
  GridFrame frame;
  DeviceBuffer<int32_t> links;
  DeviceBuffer<float> dense_density;
  DeviceBuffer<uint8_t> empty_distance;
  DeviceBuffer<int32_t> vertex_of_voxel;
  DeviceBuffer<float> records;  // [N, stride]
  // In a field that is being fitted, a voxel's gradient and moment follow its values: the data
  // of one step is on one page of memory.
  bool fitting = false;
  // Gradients are 64-bit integers (AddExact in gradient_view.h), so a fit is bitwise
  // reproducible.
  bool exact_sums = false;
  int basis = 9;
  Vec3f background{0, 0, 0};
  float near_clip = 0;
  DeviceSpheres spheres;

  int lanes() const { return RecordLanes(basis); }
  int stride() const { return (!fitting ? 1 : exact_sums ? 4 : 3) * lanes(); }
  int64_t num_voxels() const { return records.size() / stride(); }
  // See DeviceGridView.
  int64_t first_texel() const { return (num_voxels() + 31) / 32 * 32; }
  int64_t num_points() const {
    return spheres.on() ? first_texel() + spheres.num_texels() : num_voxels();
  }
  DeviceGridView view() const;
  // Gradients, and then moments, with the same stride; only of a field that is being fitted.
  float* gradient() const { return records.data() + lanes(); }
  float* second_moment() const { return records.data() + (stride() - lanes()); }
};

// `second_moment` [N, lanes], or empty for zeros; `sphere_moment` has the texels' shape.
DeviceGrid UploadGrid(const FastGrid& grid, bool fitting = false,
                      const Buffer<float>& second_moment = {}, bool exact_sums = false,
                      const Buffer<float>& sphere_moment = {});
// Gradients [N, lanes] of a grid that is being fitted.
Buffer<float> DownloadGradient(const DeviceGrid& grid);
Buffer<float> DownloadSecondMoment(const DeviceGrid& grid);
FastGrid DownloadGrid(const DeviceGrid& grid);

// Recomputes dense_density, vertex_of_voxel and empty_distance from the existing links and
// records; `num_voxels` is the number of non-negative links.
void RefreshDerived(DeviceGrid* grid, int64_t num_voxels);

// Prunes and resamples as Resample in resample_grid.h does: a new vertex is kept if the old
// vertex nearest to it, or one of that vertex's 26 neighbours, has a weight of at least
// `threshold`. weights [N]. Gradients and moments of a field that is being fitted become 0.
// Returns an empty grid (no voxels) if nothing is left. Background layers stay with `grid`.
DeviceGrid ResampleOnDevice(const DeviceGrid& grid, const DeviceBuffer<float>& weights,
                            float threshold, const Vec3i& resolution);

}  // namespace regrade
