// Background spheres for a fit: allocates the texels that photos see and resamples from coarse
// to fine.
#pragma once

#include "kernels/field/packed_grid.h"
#include "kernels/field/radiance_field.h"
#include "reconstruct/fit/training_rays.h"

namespace regrade {

// Texels from pole to pole at a stage whose grid has `stage` voxels along its longest side;
// `resolution` texels belong to the last stage, with `last` voxels.
int SphereResolutionFor(int resolution, int stage, int last);

// Layers of one density and colour (sRGB), with the texel columns that training rays cross.
// Throws Error(kResources) if there are too many texels to index.
FastSpheres MakeInitialSpheres(const TrainingRays& rays, const GridFrame& frame, int layers,
                               int resolution, float density, const Vec3f& color);

// The layers interpolated bilinearly on maps of `resolution`.
FastSpheres ResampleSpheres(const FastSpheres& spheres, int resolution);

}  // namespace regrade
