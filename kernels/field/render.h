// Rendering a field at a camera: colour, depth and what transmittance is left.
#pragma once

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

// The fast path of this machine. Rays go through the camera's lens.
RenderedView RenderView(const RadianceField& field, const Camera& camera,
                        const MarchOptions& options);

// The plain body: the specification and the tests' oracle.
RenderedView RenderViewPlain(const RadianceField& field, const Camera& camera,
                             const MarchOptions& options, Backend backend = Backend::kCpu);

}  // namespace regrade
