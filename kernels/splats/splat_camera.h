// What a picture of splats depends on besides them: the camera, and the constants of the
// method.
#pragma once

#include <cstdint>

#include "kernels/base/random.h"
#include "kernels/base/random_streams.h"
#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

inline constexpr double kMaxAlpha = 0.99;                   // of one splat at a pixel
inline constexpr double kLogMinAlpha = -5.541263545158426;  // ln(1 / 255): less is left out
inline constexpr double kMinTransmittance = 1e-4;           // what would leave less is left out

// EQ(splat-dropout), Park et al. 2025 (DropGaussian), eq. 4 and 5: in each step of a fit a
// share r of the splats, drawn anew, is left out, and the opacities of the others are divided
// by 1 - r (up to the most of one splat): none learns to explain a photo alone, and what few
// photos see gets gradients behind what covers it. How r rises: FitSplats.
struct SplatDropout {
  float share = 0;  // r, less than 1
  float gain = 1;   // 1 / (1 - r)
  uint64_t seed = 0, step = 0;

  SplatDropout() = default;
  SplatDropout(float share, uint64_t seed, uint64_t step)
      : share(share), gain(1 / (1 - share)), seed(seed ^ kRandomSplatDropout), step(step) {}

  HD bool Drops(int64_t i) const {
    if (!(share > 0)) return false;
    const uint64_t bits = RandomBits(seed, step, static_cast<uint64_t>(i));
    return static_cast<float>(bits >> 40) < share * 16777216.0f;  // 2^24
  }
};

struct SplatOptions {
  double near_plane = 0.2;  // world units, > 0: splats whose mean is nearer are left out
  double blur = 0.3;        // pixels^2, > 0: added to the variance along both image axes
  // Of the pictures that the splats were fitted to, the tangent of a pixel's angle (1 / focal
  // length in pixels), see EQ(splat-filter). 0: they were fitted with that filter; below 0: not
  // known, taken as this picture's.
  double fit_pixel = -1;
  SplatDropout dropout;
};

// A pinhole camera in numbers for host and device.
struct SplatCamera {
  int width = 0, height = 0;              // pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  Mat3d rotation;                         // camera_from_world
  Vec3d translation, center;

  SplatCamera() = default;
  // `camera.lens` must be kPinhole, and `camera.ndc` off.
  explicit SplatCamera(const Camera& camera)
      : width(camera.width),
        height(camera.height),
        fx(camera.fx),
        fy(camera.fy),
        cx(camera.cx),
        cy(camera.cy),
        rotation(camera.camera_from_world.rotation),
        translation(camera.camera_from_world.translation),
        center(camera.Center()) {}
};

}  // namespace regrade
