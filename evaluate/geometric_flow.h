// Exact motion between two views of a known scene: from depth and cameras, with visibility by a
// depth test, without any estimation of flow.
#pragma once

#include "evaluate/flow_field.h"
#include "evaluate/occlusion.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

// EQ(geometric-flow): pixel p of view i sees X = center_i + depth_i(p) d_i(p), with d_i the
// unit world ray through p's centre; flow(p) = project_j(X) - p.
//
// Depths have one channel: the distance along the pixel's unit ray in world units, as the
// renderer gives it; values that are not positive and finite mean "nothing there". Both depth
// images have their camera's size, and both cameras one size.
//
// `visible` (one channel, 0 or 1; may be null) is 1 where the second view sees the same surface
// point: all four taps around the target are in the frame, each tap's z depth is within 5 % of
// X's z depth (taps on both sides of a silhouette would mix two surfaces), and the z depth
// interpolated there (in 1/z, exact for planes) is within 1 % of X's. Where nothing is there,
// or X is behind the second camera, the flow is NaN and `visible` 0.
FlowField GeometricFlow(const Image& depth_i, const Camera& camera_i, const Image& depth_j,
                        const Camera& camera_j, Image* visible);

// The same as a mask with counts: nothing there / behind the camera is not_finite, hidden is
// disoccluded.
OcclusionMask GeometricMask(const FlowField& flow, const Image& visible);

}  // namespace regrade
