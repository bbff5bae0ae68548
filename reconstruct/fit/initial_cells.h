// The first cells of an adaptive fit, and the rates of its densities.
#pragma once

#include "kernels/field/packed_grid.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

// The frame of an adaptive field: `coarsest` cells of level 0 on the longest side, `finest`
// levels below it.
GridFrame CellFrame(const SceneBox& box, int coarsest, int finest);

// A mid-grey field of one density: the cells of level 0 of which at least `min_views` cameras
// see the centre or a corner, beyond near_clip. With `ball`, only cells that touch the box's
// unit sphere.
FastGrid MakeInitialCells(const TrainingRays& rays, const GridFrame& frame, int finest,
                          int basis, float density, float near_clip, int min_views, bool ball);

// Factors of the density's rate, [V]: the number of photos that see a vertex, over the number
// that see the best seen one. What few photos see settles slowly, so that it takes shape where
// more photos agree (Sun, Sun, Chen 2022, DVGO, section 5.2). The factor is exact on a lattice
// of at most 48 vertices a side and blended between them.
Buffer<float> DensityRates(const TrainingRays& rays, const GridFrame& frame,
                           const CellGrid& cells, float near_clip);

}  // namespace regrade
