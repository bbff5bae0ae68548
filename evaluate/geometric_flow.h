// Exact motion between two views of a known scene from depth and cameras, with visibility by a
// depth test.
#pragma once

#include "evaluate/flow_field.h"
#include "evaluate/occlusion.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

// EQ(geometric-flow): pixel p of view i sees X = center_i + depth_i(p) d_i(p), with d_i the
// unit world ray through p's centre; flow(p) = project_j(X) - p.
//
// Depths have one channel: the distance along the pixel's unit ray in world units, as rendered;
// values that are not positive and finite mean "no surface". Each depth image has its camera's
// size, and both cameras have one size.
//
// `visible` (one channel, 0 or 1; may be null) is 1 where the second view sees the same surface
// point: all four taps around the target are in the frame, each tap's z depth is within 5 % of
// X's z depth (taps on both sides of a silhouette would mix two surfaces), and the z depth
// interpolated there (in 1/z, exact for planes) is within 1 % of X's. Without a surface, or if
// X is behind the second camera, the flow is NaN and `visible` 0.
FlowField GeometricFlow(const Image& depth_i, const Camera& camera_i, const Image& depth_j,
                        const Camera& camera_j, Image* visible);

// The same as a mask with counts: no surface or behind the camera counts as not_finite, hidden
// as disoccluded.
OcclusionMask GeometricMask(const FlowField& flow, const Image& visible);

}  // namespace regrade
