// Refines a grid from coarse to fine: prunes voxels by rendering weight and resamples the rest.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "reconstruct/fit/fit_options.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

// A mid-grey grid of one density that stores every vertex seen by at least `min_views` cameras
// beyond near_clip; 0 stores all. With `ball`, only vertices within the box's unit sphere.
FastGrid MakeInitialGrid(const TrainingRays& rays, const GridFrame& frame, int basis,
                         float density, float near_clip, int min_views, bool ball = false);

// Whether two cameras see one place of the frame, beyond near_clip: looks at as many places a
// side as the frame has vertices, and at 32 of more.
bool TwoViewsShareAPlace(const TrainingRays& rays, const GridFrame& frame, float near_clip);

// Largest rendering weight of each voxel in any training view, from every `stride`-th row and
// column.
Buffer<float> MaxWeightsOverViews(const FastGrid& grid, const TrainingRays& rays,
                                  const MarchOptions& options, int stride);

// The vertices of a stage along x, y and z.
Vec3i GridOfStage(const FitOptions& options, const SceneBox& box, size_t stage);

// The least of `weights` to keep, at least `least`: raised, as in svox2, where more than `most`
// would stay. Their neighbours, which stay, too, are not counted. most 0: no limit.
float BoundedLimit(const Buffer<float>& weights, float least, int64_t most);

// The field interpolated trilinearly on a grid of `resolution`; keeps vertices within one voxel
// of an old voxel whose weight is at least `threshold`. Throws Error(kScene) naming the
// threshold and the largest weight if no voxel would remain (H85).
FastGrid Resample(const FastGrid& grid, const Buffer<float>& weights, float threshold,
                  const Vec3i& resolution);

}  // namespace regrade
