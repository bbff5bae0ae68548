// The first cells of an adaptive fit, and the rates of its densities.
#pragma once

#include "kernels/field/packed_grid.h"
#include "reconstruct/fit/training_rays.h"
#include "reconstruct/scene/scene_box.h"

namespace regrade {

// Levels of an adaptive fit. Around the box there is a region 2^outward times as wide, for what
// photos show behind the scene.
struct CellLevels {
  int finest = 0;   // times that the box's first cells can be halved
  int outward = 0;  // times that the region's first cells are wider: level 0 is theirs
  int all() const { return finest + outward; }
};

// The frame of an adaptive field: `coarsest` first cells on the box's longest side, and as many
// of level 0 on that of the region.
GridFrame CellFrame(const SceneBox& box, int coarsest, const CellLevels& levels);

// A mid-grey field of one density: cells of level `outward` in the box and of level 0 around
// it, of which at least `min_views` cameras see the centre or a corner, beyond near_clip. With
// `ball`, only cells that touch the frame's sphere. There may be none.
FastGrid MakeInitialCells(const TrainingRays& rays, const GridFrame& frame,
                          const CellLevels& levels, int basis, float density, float near_clip,
                          int min_views, bool ball);

// Whether two cameras see one place of the frame, beyond near_clip: looks at as many places a
// side as the frame has vertices, and at 32 of more.
bool TwoViewsShareAPlace(const TrainingRays& rays, const GridFrame& frame, float near_clip);

// Factors of the density's rate, [V]: the number of photos that see a vertex, over the number
// that see the best seen one. What few photos see settles slowly, so that it takes shape where
// more photos agree (Sun, Sun, Chen 2022, DVGO, section 5.2). Vertices of later stages take the
// factor between those of their parents.
Buffer<float> DensityRates(const TrainingRays& rays, const GridFrame& frame,
                           const CellGrid& cells, float near_clip);

}  // namespace regrade
