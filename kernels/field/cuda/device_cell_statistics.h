// MeasureCells of reconstruct/fit/measure_cells.h on a CUDA device.
#pragma once

#include "kernels/field/cell_statistics.h"
#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/cuda/device_views.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// Of every `stride`-th row and column of each photo; arrays on the host.
CellStatistics MeasureCellsOnDevice(const DeviceGrid& grid, const DeviceViews& views,
                                    const MarchOptions& march, int stride);

}  // namespace regrade
