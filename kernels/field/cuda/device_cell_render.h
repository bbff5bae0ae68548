// Rendering of adaptive fields on a CUDA device: the bodies of RenderOnDevice and
// RenderFrameOnDevice for them. Every sample is shaded.
#pragma once

#include "kernels/field/cuda/device_rays.h"

namespace regrade {

void RenderCellRays(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target);
void RenderCellFrame(const DeviceGrid& grid, const Camera& camera, const MarchOptions& options,
                     const DeviceRenderTarget& target);

}  // namespace regrade
