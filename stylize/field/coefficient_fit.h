// The least squares of all colour coefficients of a field to pictures: the ceiling of what any
// style of it can reach.
#pragma once

#include <cstdint>
#include <vector>

#include "kernels/base/progress.h"
#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"
#include "kernels/scene/image.h"

namespace regrade {

struct CoefficientFitOptions {
  int steps = 60;                        // of conjugate gradients
  int64_t most_rays = int64_t{1} << 40;  // of all views, chosen at random
  uint64_t seed = 0;
  int harmonics = 16;  // at most; 1: only a colour is added to each voxel
};

// EQ(coefficient-fit), as Instant Colorization solves it for splats: coefficients x_vck of
// voxel v, channel c and harmonic k that minimise
//   sum over rays r and c of (sum_v W_rv sum_k Gamma_k(d_r) x_vck - t_rc)^2,
// W_rv the weight of v in r, see EQ(voxel-residual), d_r the ray's direction (of splats d_rv,
// see EQ(splat-color)) and t_r = `missing` [H, W, 3], one for each camera, at r's pixel; pixels
// that are not finite do not count. By `steps` of conjugate gradients from x = 0: what is seen
// from few places is not driven far. Clamps of colours are left out.
//
// Returns the field with x added; it has 9 harmonics, or its own 16. Deterministic for any
// number of threads.
RadianceField FitCoefficients(RadianceField field, const std::vector<Camera>& cameras,
                              const std::vector<Image>& missing,
                              const CoefficientFitOptions& options,
                              const ProgressFunction& progress = {});

}  // namespace regrade
