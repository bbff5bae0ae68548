// Rays through the cells of an adaptive field, a thread a ray: the walk from cell to cell is
// sequential. It leaves lists of samples, on which a warp then works as on those of a uniform
// grid, some samples at a time.
#pragma once

#include "kernels/field/cuda/device_grid.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// A ray's list ends here, as if its transmittance were below the limit. Only what composites
// counts.
inline constexpr int kMostCellSamples = 4096;

// The samples of rays that composite, front to back: [rays, capacity, 4] of each.
struct CellSamples {
  float* place = nullptr;          // eight times the cell (as bits), fraction
  float* raw_tau = nullptr;        // three values that are left to the reader, optical depth
  float* rest = nullptr;           // transmittance before, delta, t (world units), unused
  int32_t* count = nullptr;        // [rays]
  float* transmittance = nullptr;  // [rays]: behind the last sample
  int capacity = 0;
};

// Owner of the lists of up to `rays` rays at a time.
class CellSampleStore {
 public:
  CellSampleStore() = default;
  // As many rays as fit into max_bytes, at most `rays`.
  CellSampleStore(const GridFrame& frame, int64_t rays, int64_t max_bytes);
  int64_t rays() const { return count_.size(); }
  CellSamples view();

 private:
  int capacity_ = 0;
  DeviceBuffer<float> place_, raw_tau_, rest_, transmittance_;
  DeviceBuffer<int32_t> count_;
};

// Fills the lists of n <= store->rays() rays.
void MarchCellsOnDevice(const DeviceGrid& grid, const Ray* rays, int64_t n,
                        const MarchOptions& options, const CellSamples& samples);

}  // namespace regrade
