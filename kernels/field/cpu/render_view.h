// Renders a field at a camera on the CPU's fast path.
#pragma once

#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/render.h"
#include "kernels/scene/camera.h"

namespace regrade {

// Renders with the fast path of this processor. Rays include the lens distortion. For many
// views create the grid once (MakeFastGrid in packed_grid.h).
RenderedView RenderView(const FastGrid& grid, const Camera& camera,
                        const MarchOptions& options);
RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options);

}  // namespace regrade
