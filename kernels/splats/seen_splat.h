// A splat as a camera sees it, and the gradient by its values from sums over its pixels.
#pragma once

#include <cstdint>

#include "kernels/splats/extent.h"
#include "kernels/splats/projection.h"
#include "kernels/splats/splat_camera.h"
#include "kernels/splats/splat_color.h"
#include "kernels/splats/splats.h"

namespace regrade {

template <typename T>
struct SeenSplat {
  int32_t index = 0;  // among all splats
  T z = 0;            // of the mean, camera coordinates
  ScreenEllipse<T> ellipse;
  T log_opacity = 0, reach = 0;  // see EQ(splat-extent)
  Vec3<T> color;
};

// False if the camera does not see splat i anywhere.
template <typename T>
HD bool SeeSplat(const SplatCamera& camera, const SplatOptions& options,
                 const SplatsView<T>& splats, int64_t i, SeenSplat<T>* seen) {
  if (!IsUsable(splats, i) || options.dropout.Drops(i)) return false;
  const Splat<T> splat = splats[i];
  SplatProjection<T> projection;
  if (!ProjectSplat(camera, options, splat, &projection)) return false;
  seen->index = static_cast<int32_t>(i);
  seen->z = static_cast<T>(projection.at.z);
  seen->ellipse = projection.ellipse;
  if (!SplatReach(splat.opacity_logit, projection.ellipse.filter * T(options.dropout.gain),
                  &seen->log_opacity, &seen->reach))
    return false;
  seen->color = SplatColor(splats.basis, splats.Coefficients(i),
                           DirectionToMean(camera.center, splat.mean).unit);
  return true;
}

// Sums of a splat over pixels, see EQ(splat-composite-adjoint).
template <typename T>
struct SplatSums {
  EllipseSums<T> ellipse;
  Vec3<T> color;  // sum w d_C
  T z = 0;        // sum w d_Z

  template <typename U>
  HD void Add(const SplatSums<U>& more) {
    for (int a = 0; a < 2; ++a) ellipse.h[a] += more.ellipse.h[a];
    for (int a = 0; a < 3; ++a) ellipse.H[a] += more.ellipse.H[a];
    ellipse.f += more.ellipse.f;
    color += more.color.template Cast<T>();
    z += more.z;
  }
};

// Adds to d and d_sh [3, basis] of the splat.
template <typename T, typename Sum>
HD void SeeSplatAdjoint(const SplatCamera& camera, const SplatOptions& options,
                        const SplatsView<T>& splats, const SeenSplat<T>& seen,
                        const SplatSums<Sum>& sums, Splat<T>* d, T* d_sh) {
  const Splat<T> splat = splats[seen.index];
  SplatProjection<T> projection;
  if (!ProjectSplat(camera, options, splat, &projection)) return;
  EllipseSums<T> ellipse;
  for (int a = 0; a < 2; ++a) ellipse.h[a] = static_cast<T>(sums.ellipse.h[a]);
  for (int a = 0; a < 3; ++a) ellipse.H[a] = static_cast<T>(sums.ellipse.H[a]);
  ellipse.f = static_cast<T>(sums.ellipse.f);
  ProjectSplatAdjoint(camera, options, splat, projection, ellipse, static_cast<T>(sums.z), d);
  d->opacity_logit += ellipse.f * LogSigmoidDerivative(splat.opacity_logit);
  SplatColorAdjoint(splats.basis, splats.Coefficients(seen.index),
                    DirectionToMean(camera.center, splat.mean), seen.color,
                    sums.color.template Cast<T>(), d_sh, &d->mean);
}

}  // namespace regrade
