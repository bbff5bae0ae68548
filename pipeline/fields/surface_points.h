// Points on the surfaces of a field, from its renders.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade {

struct SurfacePoint {
  Vec3f place;
  std::array<uint8_t, 3> color;  // sRGB
};

// What the pixels of `cameras`, in the field's frame, see at the depth of their rays.
// A pixel counts if little light passes behind it and its neighbours' depths are near its own,
// so that edges leave no points in the air. One point in each cube of 1 / `resolution` of the
// box's longest side. Approximate: a field has no surface, and its colours change with
// direction. In the order of cameras and pixels.
std::vector<SurfacePoint> SurfacePoints(const RadianceField& field,
                                        const std::vector<Camera>& cameras, int resolution);

// A binary PLY file with x, y, z and red, green, blue; `comment` is a line of its header.
// Places go through the inverse of `field_from_world`. Throws Error(kResources).
void WritePly(const std::string& path, const std::vector<SurfacePoint>& points,
              const Similarity& field_from_world, const std::string& comment);

}  // namespace regrade
