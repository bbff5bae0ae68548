// Rendering a field at a camera on the CPU's fast path.
#pragma once

#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/render.h"
#include "kernels/scene/camera.h"

namespace regrade {

// The fast path of this machine. Rays go through the camera's lens. For many views make the
// grid once (MakeFastGrid in packed_grid.h).
RenderedView RenderView(const FastGrid& grid, const Camera& camera,
                        const MarchOptions& options);
RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options);

}  // namespace regrade
