// Rendering of adaptive fields on a CUDA device, a thread a ray; see cell_ray.h. Every sample
// is evaluated.
#pragma once

#include "kernels/field/cuda/device_rays.h"

namespace regrade {

// Cells that a frame's camera sees wider than this are wide; see EQ(vertex-colors).
inline constexpr float kWideAngle = 1.0f / 32;  // radians

// The body of RenderOnDevice for adaptive fields.
void RenderCellRays(const DeviceGrid& grid, const Ray* rays, int64_t n,
                    const MarchOptions& options, const DeviceRenderTarget& target);

// The body of RenderFrameOnDevice for them. With room for the vertices' colours the frame is
// made of those; without, it is exact.
void RenderCellFrame(const DeviceGrid& grid, const Camera& camera, const MarchOptions& options,
                     const DeviceRenderTarget& target, const VertexColors* colors,
                     float wide_angle = kWideAngle);

}  // namespace regrade
