#include "kernels/field/ray_weights.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/background_spheres.h"
#include "kernels/field/field_kind.h"
#include "kernels/field/ray_march.h"
#include "kernels/field/trilinear.h"
#include "kernels/field/volume_rendering.h"

namespace regrade {
namespace {

// CompositeSpheres without colours.
void MarchSpheres(const Geometry& geometry, const Ray& world_ray, float stop, float min_weight,
                  CompositeState<float>* state, std::vector<WeightedSample>* out) {
  const SphereGeometry& spheres = geometry.spheres;
  const SphereRay<float> ray = ToSphereRay(geometry.frame, world_ray);
  if (!(ray.world_per_unit > 0)) return;
  const float delta = ray.world_per_unit / static_cast<float>(spheres.layers);
  for (int i = 0; i < spheres.layers; ++i) {
    Vec3f place;
    float ahead;
    if (!CrossSphere(ray, InverseRadius<float>(i, spheres.layers), &place, &ahead)) continue;
    const TexelCell<float> cell = LocateTexel(spheres.resolution, place);
    float density = 0;
    for (int k = 0; k < 4; ++k) {
      const int32_t column = spheres.links[cell.texel[k]];
      if (column < 0) continue;
      density += cell.weight[k] * spheres.density[int64_t{column} * spheres.layers + i];
    }
    if (!(density > 0)) continue;
    const float w = Composite(OpticalDepth(density, delta), Vec3f{}, state);
    if (w > min_weight)
      out->push_back({~(cell.texel[0] * spheres.layers + i),
                      {cell.weight[2] + cell.weight[3], cell.weight[1] + cell.weight[3], 0},
                      w});
    if (state->transmittance < stop) break;
  }
}

// RenderRay without colours: the same arithmetic, so that weights agree bit for bit.
float MarchDensity(const Geometry& geometry, const Ray& ray, const MarchOptions& options,
                   float near_clip, float min_weight, std::vector<WeightedSample>* out) {
  CompositeState<float> state;
  const GridFrame& frame = geometry.frame;
  const GridRay<float> march = ClipToGrid(frame, ray, near_clip, options.step);
  const float delta = options.step * march.world_per_voxel;
  for (int64_t i = 0; i < march.num_steps; ++i) {
    const float t = march.t_begin + static_cast<float>(i) * options.step;
    const Cell<float> cell = LocateCell(frame, march.At(t));
    float density;
    Interpolate(frame, geometry.links.data(), geometry.density.data(), 1, 1, cell, &density);
    if (!(density > 0)) continue;
    const float w = Composite(OpticalDepth(density, delta), Vec3f{}, &state);
    if (w > min_weight) out->push_back({cell.vertex, cell.fraction, w});
    if (state.transmittance < options.stop_transmittance) break;
  }
  if (geometry.spheres.on() && !(state.transmittance < options.stop_transmittance))
    MarchSpheres(geometry, ray, options.stop_transmittance, min_weight, &state, out);
  return state.transmittance;
}

}  // namespace

void CornerPoints(const Geometry& geometry, const WeightedSample& sample, int32_t* point) {
  KindOf(geometry).find_points(geometry, sample, point);
}

RayWeights ComputeRayWeights(const Geometry& geometry, View<const Ray> rays,
                             const MarchOptions& options, float near_clip, float min_weight) {
  constexpr int64_t kBlock = 256;
  const int64_t num_blocks = (rays.size + kBlock - 1) / kBlock;
  std::vector<std::vector<WeightedSample>> blocks(static_cast<size_t>(num_blocks));
  std::vector<int64_t> counts(static_cast<size_t>(rays.size));
  RayWeights result;
  result.transmittance.resize(static_cast<size_t>(rays.size));
#pragma omp parallel for schedule(dynamic, 1)
  for (int64_t b = 0; b < num_blocks; ++b) {
    auto& samples = blocks[static_cast<size_t>(b)];
    for (int64_t r = b * kBlock; r < std::min(rays.size, (b + 1) * kBlock); ++r) {
      const size_t before = samples.size();
      result.transmittance[static_cast<size_t>(r)] =
          MarchDensity(geometry, rays[r], options, near_clip, min_weight, &samples);
      counts[static_cast<size_t>(r)] = static_cast<int64_t>(samples.size() - before);
    }
  }
  result.first.assign(1, 0);
  result.first.reserve(counts.size() + 1);
  for (const int64_t count : counts) result.first.push_back(result.first.back() + count);
  result.samples.reserve(static_cast<size_t>(result.first.back()));
  for (const auto& block : blocks)
    result.samples.insert(result.samples.end(), block.begin(), block.end());
  return result;
}

}  // namespace regrade
