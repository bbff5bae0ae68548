// Converts a ray's raw sums to a pixel: clips the colour and converts the length along the ray
// to the depth along the optical axis.
#pragma once

#include "kernels/base/vec.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct ResolvePixel {
  Vec3d axis;         // world direction of the optical axis
  double offset = 0;  // depth of a world point p is Dot(axis, p) + offset
  NdcSpace ndc;

  explicit ResolvePixel(const Camera& camera)
      : axis(camera.Forward()),
        offset(camera.camera_from_world.translation.z),
        ndc(camera.ndc) {}

  // On entry `depth` is sum w t. It becomes 0 (undefined) if sum w < 1/2.
  HD void operator()(const Ray& ray, float transmittance, Vec3f* color, float* depth) const {
    for (int c = 0; c < 3; ++c) {
      float& value = (*color)[c];
      value = value < 0 ? 0.0f : value > 1 ? 1.0f : value;
    }
    const float opaque = 1.0f - transmittance;
    if (!(opaque >= 0.5f))
      *depth = 0;
    else if (ndc.on())
      *depth = NdcDepth(ray, *depth / opaque);
    else
      *depth = *depth / opaque * Dot(ray.direction, axis.Cast<float>());
  }

 private:
  // Depth of the point at `length` along a ray in NDC. Infinity becomes z = 1e4 near planes.
  HD float NdcDepth(const Ray& ray, float length) const {
    Vec3d p = (ray.origin + ray.direction * length).Cast<double>();
    if (p.z > 1 - 2e-4) p.z = 1 - 2e-4;
    return static_cast<float>(Dot(axis, WorldFromNdc(ndc, p)) + offset);
  }
};

}  // namespace regrade
