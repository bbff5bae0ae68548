// Background spheres for a fit: which texels the photos can say anything about, and growing
// from coarse to fine.
#pragma once

#include "kernels/field/packed_grid.h"
#include "kernels/field/radiance_field.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// Texels from pole to pole at a stage whose grid has `stage` voxels along its longest side,
// where the last stage's has `last`.
int SphereResolutionFor(int resolution, int stage, int last);

// Layers whose columns some training ray comes by, of one density and colour (sRGB). Throws
// Error(kResources) if there are too many texels to number.
FastSpheres MakeInitialSpheres(const TrainingRays& rays, const GridFrame& frame, int layers,
                               int resolution, float density, const Vec3f& color);

// The layers on maps of `resolution`, bilinearly.
FastSpheres ResampleSpheres(const FastSpheres& spheres, int resolution);

}  // namespace regrade
