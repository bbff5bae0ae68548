#include "pipeline/fields/surface_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <unordered_set>

#include "kernels/base/error.h"
#include "kernels/render/field_renderer.h"
#include "pipeline/files/atomic_file.h"

namespace regrade {
namespace {

constexpr float kMostBehind = 0.1f;  // transmittance
constexpr float kMostSlope = 0.05f;  // of depth, from a pixel to its neighbours

bool OnSurface(const RenderedView& view, int x, int y) {
  const float depth = *view.depth.at(x, y);
  if (!(depth > 0) || *view.transmittance.at(x, y) > kMostBehind) return false;
  for (const auto& [nx, ny] : {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
    if (nx < 0 || ny < 0 || nx >= view.depth.width || ny >= view.depth.height) return false;
    if (!(std::abs(*view.depth.at(nx, ny) - depth) < kMostSlope * depth)) return false;
  }
  return true;
}

}  // namespace

std::vector<SurfacePoint> SurfacePoints(const RadianceField& field,
                                        const std::vector<Camera>& cameras, int resolution) {
  const FieldRenderer renderer(field, Backend::kCpu);
  const Vec3f radius = field.geometry->frame.radius;
  const double side = 2.0 * std::max({radius.x, radius.y, radius.z}) / resolution;
  std::vector<SurfacePoint> points;
  std::unordered_set<uint64_t> taken;
  for (const Camera& camera : cameras) {
    const RenderedView view = renderer.Render(camera);
    const RigidTransform world_from_camera = camera.camera_from_world.Inverse();
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        if (!OnSurface(view, x, y)) continue;
        const Vec3d ray = camera.CameraRay(x + 0.5, y + 0.5);
        if (!(ray.z > 0.05)) continue;
        const double depth = static_cast<double>(*view.depth.at(x, y));
        const Vec3d place = world_from_camera.rotation * (ray * (depth / ray.z)) +
                            world_from_camera.translation;
        uint64_t cube = 0;
        for (int a = 0; a < 3; ++a) {
          constexpr int64_t kMiddle = 1 << 20;
          const int64_t i =
              std::clamp<int64_t>(std::llround(place[a] / side), 1 - kMiddle, kMiddle - 1);
          cube = cube << 21 | static_cast<uint64_t>(i + kMiddle);
        }
        if (!taken.insert(cube).second) continue;
        SurfacePoint point;
        for (int a = 0; a < 3; ++a) {
          point.place[a] = static_cast<float>(place[a]);
          point.color[static_cast<size_t>(a)] =
              static_cast<uint8_t>(view.color.at(x, y)[a] * 255 + 0.5f);
        }
        points.push_back(point);
      }
  }
  return points;
}

void WritePly(const std::string& path, const std::vector<SurfacePoint>& points,
              const Similarity& field_from_world, const std::string& comment) {
  static_assert(std::endian::native == std::endian::little);
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\ncomment " + comment + "\nelement vertex " +
      std::to_string(points.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
      "property uchar green\nproperty uchar blue\nend_header\n";
  for (const SurfacePoint& point : points) {
    Vec3d moved;
    for (int a = 0; a < 3; ++a)
      moved[a] = (static_cast<double>(point.place[a]) - field_from_world.translation[a]) /
                 field_from_world.scale;
    const Vec3d world = field_from_world.rotation.Transposed() * moved;
    float place[3];
    for (int a = 0; a < 3; ++a) place[a] = static_cast<float>(world[a]);
    char text[sizeof place];
    std::memcpy(text, place, sizeof place);
    bytes.append(text, sizeof place);
    for (const uint8_t c : point.color) bytes += static_cast<char>(c);
  }
  WriteFileAtomically(path, bytes);
}

}  // namespace regrade
