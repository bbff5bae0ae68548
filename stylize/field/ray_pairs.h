// Pairs of rays whose colours are compared before and after styling: neighbouring pixels of one
// view, for the structure of pictures, and pixels of two views that see one point, for their
// consistency (LipRF, figure 2, left and right).
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/render/ray_weigher.h"
#include "kernels/scene/view_rays.h"

namespace regrade {

// Rays 2 i and 2 i + 1 are pair i.
using RayPairs = ViewRays;

// `count` pixels of random views with the one to the right of or below each.
RayPairs NeighbouringPixels(const std::vector<Camera>& cameras, int64_t count, uint64_t seed);

// At most `count` pairs: a pixel of a random view, and the ray of the next view, in the order
// of `cameras` and from the last to the first, through the point that the pixel sees, see
// EQ(geometric-flow). The point must lie in the next view's frame, and that ray's own depth be
// within 1 % of the point's, as the evaluator asks. Rays that let more light pass than they
// meet have no depth. Fewer than two cameras have no pairs. The same for any number of threads.
// `weigher`: of the field, with min_weight 0.
RayPairs PixelsOfOnePoint(const RadianceField& field, const std::vector<Camera>& cameras,
                          int64_t count, uint64_t seed, RayWeigher* weigher);

}  // namespace regrade
