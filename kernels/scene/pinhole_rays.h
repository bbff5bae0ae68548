// The rays through a frame's pixels, on host or device: bit-identical to Camera::PixelRay for
// a camera without distortion.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct PinholeRays {
  int width = 0, height = 0;              // pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  // pixels
  Vec3d origin;                           // world
  Mat3d world_from_camera;
  NdcSpace ndc;

  PinholeRays() = default;
  // `camera.lens` must be kPinhole.
  explicit PinholeRays(const Camera& camera)
      : width(camera.width),
        height(camera.height),
        fx(camera.fx),
        fy(camera.fy),
        cx(camera.cx),
        cy(camera.cy),
        origin(camera.Center()),
        world_from_camera(camera.camera_from_world.rotation.Transposed()),
        ndc(camera.ndc) {}

  // Through the centre of pixel (x, y), in the field's space.
  HD Ray At(int x, int y) const {
    Vec3d from = origin;
    Vec3d direction =
        Normalized(world_from_camera * Vec3d{(x + 0.5 - cx) / fx, (y + 0.5 - cy) / fy, 1.0});
    if (ndc.on()) NdcRay(ndc, &from, &direction);
    return {from.Cast<float>(), direction.Cast<float>()};
  }
};

}  // namespace regrade
