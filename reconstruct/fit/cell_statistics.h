// What the training photos say of each cell of an adaptive field, and which cells are split and
// removed for it.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/refine_cells.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// Of each cell, over the rays of all photos; [C] each.
struct CellStatistics {
  Buffer<float> weight;    // the largest w_i of EQ(composite)
  Buffer<float> pixels;    // its width in pixels in the photo that sees it second largest, of
                           // those that give it a weight of kSeenWeight; 0 if fewer than two do
  Buffer<uint64_t> error;  // sum of w_i |C - C_photo|^2, in units of kErrorUnit: integers, so
                           // the order is free
};
inline constexpr float kSeenWeight = 1e-3f;
inline constexpr double kErrorUnit = 0x1p-24;

// Of every `stride`-th row and column of each photo.
CellStatistics MeasureCells(const FastGrid& grid, const TrainingRays& rays,
                            const MarchOptions& march, int stride);

// The width in pixels of a cell of `voxels` at `t` along a ray: `next` is the ray `stride`
// pixels beside it.
float WidthInPixels(const GridFrame& frame, const Ray& ray, const Ray& next, float t,
                    int stride, int voxels);

struct CellLimits {
  float least_weight = 0;  // cells of less in every photo are removed
  float least_pixels = 1;  // cells narrower than this are not split
  int deepest = 0;         // the finest level of this stage
  int64_t most_cells = 0;  // after the change; 0: no limit
};

// Where the cells are limited, those with the largest error are split; of equal ones the first.
std::vector<CellChange> ChooseChanges(const CellGrid& cells, const CellStatistics& statistics,
                                      const CellLimits& limits);

// Changes cells and moves records, moments [V, lanes] and rates.
void ApplyChanges(const std::vector<CellChange>& change, FastGrid* grid,
                  Buffer<float>* second_moment);

}  // namespace regrade
