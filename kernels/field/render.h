// Rendering a field at a camera: colour, depth and what transmittance is left.
#pragma once

#include <vector>

#include "kernels/base/for_each.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct RenderedView {
  Image color;  // [H, W, 3] sRGB, clipped to [0, 1]
  Image depth;  // [H, W, 1]: sum w z / sum w, z along the optical axis in world units; 0 where
                // sum w < 0.5
  Image transmittance;  // [H, W, 1]
};

struct FastGrid;

// The fast path of this machine. Rays go through the camera's lens. For many views make the
// grid once (MakeFastGrid in fast_rays.h).
RenderedView RenderView(const FastGrid& grid, const Camera& camera,
                        const MarchOptions& options);
RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options);

// The plain body: the specification and the tests' oracle.
RenderedView RenderViewPlain(const RadianceField& field, const Camera& camera,
                             const MarchOptions& options, Backend backend = Backend::kCpu);

// From raw sums to a view: colours clipped to [0, 1], ray lengths turned into depths along the
// optical axis.
void FinishView(const Camera& camera, const std::vector<Ray>& rays, RenderedView* view);

}  // namespace regrade
