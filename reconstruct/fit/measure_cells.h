// What the training photos say of each cell of an adaptive field, and which cells are split and
// removed for it.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/cell_statistics.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/refine_cells.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// Of every `stride`-th row and column of each photo.
CellStatistics MeasureCells(const FastGrid& grid, const TrainingRays& rays,
                            const MarchOptions& march, int stride);

struct CellLimits {
  // Cells of less weight in every photo are removed: this much for a cell of first_level or a
  // coarser one, and half as much for each finer level, as fog gives a cell half as wide.
  float least_weight = 0;
  int first_level = 0;
  float least_pixels = 1;  // cells narrower than this are not split
  int deepest = 0;         // the finest level of this stage
  int64_t most_cells = 0;  // after the change; 0: no limit
};

// level [C]. Where the cells are limited, those with the largest error are split; of equal ones
// the first.
std::vector<CellChange> ChooseChanges(const Buffer<uint8_t>& level,
                                      const CellStatistics& statistics,
                                      const CellLimits& limits);

// Changes cells and moves records, rates, and moments [V, lanes], times kMomentOfChildren.
void ApplyChanges(const std::vector<CellChange>& change, FastGrid* grid,
                  Buffer<float>* second_moment);

}  // namespace regrade
