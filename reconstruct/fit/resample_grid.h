// Growing a field from coarse to fine: which voxels are worth keeping, and their values on a
// finer grid.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// A grid that stores every vertex seen by at least `min_views` cameras beyond near_clip, at
// `density`, mid-grey. With `ball`, only within the unit sphere of the box: the rest is the
// background's.
FastGrid MakeInitialGrid(const TrainingRays& rays, const GridFrame& frame, int basis,
                         float density, float near_clip, int min_views, bool ball = false);

// Largest rendering weight each voxel has in any training view; every `stride`-th pixel both
// ways is looked at.
Buffer<float> MaxWeightsOverViews(const FastGrid& grid, const TrainingRays& rays,
                                  const MarchOptions& options, int stride);

// The field on a grid of `resolution`, trilinearly, keeping vertices within one voxel of an old
// voxel whose weight is at least `threshold`. Throws Error(kScene) naming the threshold and the
// largest weight if nothing would be left (H85).
FastGrid Resample(const FastGrid& grid, const Buffer<float>& weights, float threshold,
                  const Vec3i& resolution);

}  // namespace regrade
