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

// A view of a field and the colours of another one of the same geometry.
struct RenderedPair {
  RenderedView view;
  Image other_color;  // [H, W, 3] sRGB, clipped to [0, 1]
};

// To the bit what two calls of RenderView give; density is marched once.
RenderedPair RenderViewPair(const FastGrid& grid, const FastGrid& other, const Camera& camera,
                            const MarchOptions& options);

}  // namespace regrade
