// How much darker a lens shows what is away from its axis, from the colours of tracked points
// that photos see at different distances from their middles.
#pragma once

#include <algorithm>
#include <vector>

#include "reconstruct/refinement/exposure.h"

namespace regrade {

// EQ(lens-falloff): f(r) = exp(a r^2 + b r^4) of the linear light, r from 0 in the picture's
// middle to 1 in its corners. Never brighter farther out.
struct LensFalloff {
  double a = 0, b = 0;
  double LogAt(double r2) const { return r2 * (a + b * r2); }
  bool operator==(const LensFalloff&) const = default;
};

// r^2 at pixel coordinates, in which the first pixel's centre is at 0.5.
inline double Radius2(int width, int height, double x, double y) {
  const double dx = 2 * x - width, dy = 2 * y - height;
  return (dx * dx + dy * dy) / (double(width) * width + double(height) * height);
}

// Two steps of 8 bits.
inline constexpr double kFalloffCorner = 0.95;

struct FalloffEstimate {
  LensFalloff falloff;
  double corner = 1;           // f(1)
  double corner_error = 0;     // its standard error
  double explained = 0;        // fraction of what gains leave, at points that were left out
  double explained_error = 0;  // its standard error

  // A loss of light in the corners up to this may be none.
  double Threshold() const {
    return std::max(1 - kFalloffCorner, kExposureSigmas * corner_error);
  }
};

// min over a, b, log gains and log colours of the sum of EQ(exposure) with log f(r) added to
// the model; all photos have one lens. Folds and errors: see EQ(exposure-pays), where D(0) is
// that of gains alone.
FalloffEstimate EstimateFalloff(int num_views,
                                const std::vector<ColorObservation>& observations);

// The observations as a lens without falloff sees them.
std::vector<ColorObservation> WithoutFalloff(std::vector<ColorObservation> observations,
                                             const LensFalloff& falloff);

}  // namespace regrade
