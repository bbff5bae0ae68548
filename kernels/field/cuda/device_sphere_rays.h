// Training rays through the background's layers on a CUDA device; run before and after the
// box's kernel.
#pragma once

#include "kernels/field/cuda/device_rays.h"

namespace regrade {

// behind [n]: the radiance of layers and background without the box, which composites it as its
// background. A ray that ends in the layers is marched slightly farther than a ray that has
// passed the box would be; the difference is below stop_transmittance.
void SphereRadiance(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, Vec3f* behind);

// Its adjoint: adds to the gradients of a field that is being fitted. d_behind [n].
void SphereRadianceAdjoint(const DeviceGrid& grid, const Ray* rays, const Vec3f* d_behind,
                           int64_t n, const MarchOptions& options, DeviceTouched* touched,
                           DeviceFitSums* sums);

// Adds the gradient of EQ(sphere-variation) of the map's texels begin, begin + 1, ..., begin +
// count - 1, modulo their number.
void AddSphereVariation(const DeviceGrid& grid, int64_t begin, int64_t count,
                        float scale_density, float scale_color, DeviceTouched* touched);

// See StepSpheres: steps the touched texels and resets their gradients.
void StepSpheresOnDevice(DeviceGrid* grid, DeviceTouched* touched,
                         const RmspropOptions& options, DeviceFitSums* sums);

}  // namespace regrade
