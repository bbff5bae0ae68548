// Splats as a radiance field, and back.
#pragma once

#include "kernels/field/radiance_field.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splats.h"

namespace regrade {

// Of the fit and of the field that it leaves. The near plane lies at half of the near clip, so
// that what a photo shows is not cut off where a later camera is a little nearer; and at least
// at a thousandth of the box, whose half extents are `radius`. `fit_pixel`: see SplatOptions.
SplatOptions SplatOptionsFor(float near_clip, const Vec3f& radius, double fit_pixel);

// For geometry alone: a view of basis 0, without coefficients.
SplatsView<float> SplatsWithoutColors(const SplatGeometry& splats);

// `field` has splats. The view is valid as long as the field.
SplatsView<float> SplatsOf(const RadianceField& field);
SplatOptions SplatOptionsOf(const RadianceField& field);

// `frame`: the box that the cameras look at. Quaternions become unit ones.
RadianceField FieldOfSplats(const Splats& splats, const GridFrame& frame, float near_clip,
                            float fit_pixel);

}  // namespace regrade
