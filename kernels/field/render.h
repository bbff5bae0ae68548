// Renders a field at a camera: colour, depth and remaining transmittance. The fast path is in
// cpu/render_view.h.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct RenderedView {
  Image color;  // [H, W, 3] sRGB, clipped to [0, 1]
  // [H, W, 1]: sum w z / sum w, of splats the median of z, along the optical axis in world
  // units; 0 where sum w < 0.5.
  Image depth;
  Image transmittance;  // [H, W, 1]
};

// The plain specification, which the tests compare with.
RenderedView RenderViewPlain(const RadianceField& field, const Camera& camera,
                             const MarchOptions& options);

// Converts raw sums to a view: colours clipped to [0, 1], ray lengths converted to depths along
// the optical axis.
void FinishView(const Camera& camera, const std::vector<Ray>& rays, RenderedView* view);

}  // namespace regrade
