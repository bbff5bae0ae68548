// The cells of an adaptive field on a CUDA device.
#pragma once

#include <cstdint>

#include "kernels/device/device_memory.h"
#include "kernels/field/cell_grid.h"
#include "kernels/field/refine_cells.h"

namespace regrade {

// Shapes and order as in CellGrid.
struct DeviceCells {
  int finest = 0;
  DeviceBuffer<CellKey> key;
  DeviceBuffer<uint8_t> level;
  DeviceBuffer<int32_t> corner;
  DeviceBuffer<CellKey> vertex_key;
  DeviceBuffer<int32_t> top, nodes;

  bool on() const { return key.size() > 0; }
  int64_t num_cells() const { return key.size(); }
  int64_t num_vertices() const { return vertex_key.size(); }
  CellsView view(const Vec3i& voxels) const;
};

DeviceCells UploadCells(const CellGrid& cells);
CellGrid DownloadCells(const DeviceCells& cells);

// ChangeCells of refine_cells.h, with the same result; change [C] on the host.
DeviceCells ChangeCellsOnDevice(const DeviceCells& old, const Vec3i& voxels,
                                const std::vector<CellChange>& change,
                                DeviceBuffer<VertexSource>* sources);

// MoveValues, times `factor`: rows of `lanes` floats, one after the other in `values` and
// `stride` floats apart in `out`.
void MoveValuesOnDevice(const DeviceCells& from, const DeviceCells& to,
                        const DeviceBuffer<VertexSource>& sources, const float* values,
                        int lanes, float factor, int64_t stride, float* out);

}  // namespace regrade
