// What a picture of splats depends on besides them: the camera, and the constants of the
// method.
#pragma once

#include <cstdint>

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

inline constexpr double kMaxAlpha = 0.99;                   // of one splat at a pixel
inline constexpr double kLogMinAlpha = -5.541263545158426;  // ln(1 / 255): less is left out
inline constexpr double kMinTransmittance = 1e-4;           // what would leave less is left out

struct SplatOptions {
  double near_plane = 0.2;   // world units, > 0: splats whose mean is nearer are left out
  double blur = 0.3;         // pixels^2, > 0: added to the variance along both image axes
  bool antialiased = false;  // opacity is lowered by what the blur adds, see EQ(splat-filter)
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
