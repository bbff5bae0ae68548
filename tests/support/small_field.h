// A small random field and rays through it, for tests of rendering and fitting.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "kernels/base/random.h"
#include "kernels/field/radiance_field.h"
#include "kernels/scene/camera.h"

namespace regrade::testing {

// Uniform in [lo, hi), keyed by a counter.
inline double Uniform(uint64_t seed, uint64_t counter, double lo, double hi) {
  return lo + (hi - lo) * RandomDouble(seed, 77, counter);
}

// A box that is no cube, beside the origin.
inline GridFrame SmallFrame(const Vec3i& resolution) {
  return {resolution, {0.1f, -0.2f, 0.05f}, {1.0f, 0.9f, 1.1f}};
}

// About a fraction `fill` of the vertices is stored, with densities in [-2, 10) per world unit,
// so ReLU makes some of them empty.
inline RadianceField RandomField(const Vec3i& resolution, int basis, double fill,
                                 uint64_t seed) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = SmallFrame(resolution);
  geometry->links.Resize(geometry->frame.NumVertices());
  int32_t count = 0;
  for (int64_t v = 0; v < geometry->links.size(); ++v)
    geometry->links[v] = RandomDouble(seed, 1, static_cast<uint64_t>(v)) < fill ? count++ : -1;
  geometry->density.Resize(count);
  RadianceField field;
  field.appearance.basis = basis;
  field.appearance.sh.Resize(count * field.appearance.stride());
  for (int64_t i = 0; i < geometry->density.size(); ++i)
    geometry->density[i] =
        static_cast<float>(Uniform(seed, static_cast<uint64_t>(i), -2.0, 10.0));
  for (int64_t i = 0; i < field.appearance.sh.size(); ++i)
    field.appearance.sh[i] =
        static_cast<float>(Uniform(seed + 1, static_cast<uint64_t>(i), -0.6, 0.9));
  field.geometry = std::move(geometry);
  field.background = {0.3f, 0.6f, 0.2f};
  return field;
}

// A ball around the origin whose density grows by `slope` a unit of depth, of color(position,
// channel).
template <typename Color>
RadianceField VoxelBall(float radius, float slope, const Color& color) {
  RadianceField field = RandomField({24, 24, 24}, 1, 1.0, 5);
  auto geometry = std::make_shared<Geometry>(*field.geometry);
  geometry->frame.center = {0, 0, 0};
  geometry->frame.radius = {1, 1, 1};
  for (int64_t v = 0; v < geometry->links.size(); ++v) {
    const Vec3f p =
        geometry->frame.WorldOf({static_cast<float>(v / 576), static_cast<float>(v / 24 % 24),
                                 static_cast<float>(v % 24)});
    const float inside = radius - Norm(p);
    geometry->density[v] = inside > 0 ? slope * inside : -1.0f;
    for (int c = 0; c < 3; ++c) field.appearance.sh[3 * v + c] = color(p, c);
  }
  field.geometry = std::move(geometry);
  return field;
}

// Adds background layers; about a fraction `fill` of their columns is stored.
inline void AddSpheres(int layers, int resolution, double fill, uint64_t seed,
                       RadianceField* field) {
  auto geometry = std::make_shared<Geometry>(*field->geometry);
  SphereGeometry& spheres = geometry->spheres;
  spheres.layers = layers;
  spheres.resolution = resolution;
  spheres.links.Resize(int64_t{2} * resolution * resolution);
  int32_t columns = 0;
  for (int64_t i = 0; i < spheres.links.size(); ++i)
    spheres.links[i] = RandomDouble(seed, 2, static_cast<uint64_t>(i)) < fill ? columns++ : -1;
  spheres.density.Resize(int64_t{columns} * layers);
  field->appearance.sphere_color.Resize(3 * spheres.density.size());
  for (int64_t i = 0; i < spheres.density.size(); ++i)
    spheres.density[i] =
        static_cast<float>(Uniform(seed + 2, static_cast<uint64_t>(i), -1.0, 3.0));
  for (int64_t i = 0; i < field->appearance.sphere_color.size(); ++i)
    field->appearance.sphere_color[i] =
        static_cast<float>(Uniform(seed + 3, static_cast<uint64_t>(i), -2.2, 2.2));
  field->geometry = std::move(geometry);
}

// Rays from a shell outside towards points inside the box.
inline std::vector<Ray> RandomRays(int n, uint64_t seed) {
  std::vector<Ray> rays;
  for (int i = 0; i < n; ++i) {
    const uint64_t c = static_cast<uint64_t>(i) * 6;
    Vec3d origin{Uniform(seed, c, -1, 1), Uniform(seed, c + 1, -1, 1),
                 Uniform(seed, c + 2, -1, 1)};
    origin = Normalized(origin) * 2.5;
    const Vec3d target{Uniform(seed, c + 3, -0.7, 0.7), Uniform(seed, c + 4, -0.7, 0.7),
                       Uniform(seed, c + 5, -0.7, 0.7)};
    rays.push_back({origin.Cast<float>(), Normalized(target - origin).Cast<float>()});
  }
  return rays;
}

}  // namespace regrade::testing
