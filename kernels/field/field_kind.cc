#include "kernels/field/field_kind.h"

#include <algorithm>
#include <string>

#include "kernels/base/error.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/field/splat_position.h"
#include "kernels/field/trilinear.h"

namespace regrade {
namespace {

std::string DefectOfVoxels(const Geometry& geometry) {
  const int64_t vertices = geometry.frame.NumVertices();
  if (geometry.links.size() == vertices) return "";
  return Concat(geometry.links.size(), " links for a grid of ", vertices, " vertices");
}

void HasVoxels() {}

void FindVoxels(const Geometry& geometry, const WeightedSample& sample, int32_t* point) {
  if (!sample.on_sphere()) {
    for (int k = 0; k < 8; ++k)
      point[k] = geometry.links[CornerVertex(geometry.frame, sample.vertex, k)];
    return;
  }
  const SphereGeometry& spheres = geometry.spheres;
  const int r = spheres.resolution, texel = ~sample.vertex;
  const int layer = texel % spheres.layers, at = texel / spheres.layers;
  const int x = at / r, y = at % r;
  for (int k = 0; k < 8; ++k) {
    const int east = k & 4 ? (x + 1 < 2 * r ? x + 1 : 0) : x;
    const int south = k & 2 ? std::min(y + 1, r - 1) : y;
    const int32_t column = k & 1 ? -1 : spheres.links[int64_t{east} * r + south];
    point[k] = column < 0 ? -1
                          : static_cast<int32_t>(geometry.num_voxels()) +
                                column * spheres.layers + layer;
  }
}

Vec3f PositionOfVoxel(const Geometry& geometry, int64_t, int32_t vertex) {
  const Vec3i n = geometry.frame.resolution;
  Vec3f place{0.5f, 0.5f, 0.5f};  // voxels from the box's corner
  place += Vec3i{vertex / (n.y * n.z), vertex / n.z % n.y, vertex % n.z}.Cast<float>();
  Vec3f position;
  for (int a = 0; a < 3; ++a) position[a] = 2 * place[a] / static_cast<float>(n[a]) - 1;
  return position;
}

constexpr FieldKind kVoxels{.name = "voxels",
                            .far_records = "spheres",
                            .own_directions = false,
                            .lenses = true,
                            .lattice = true,
                            .sample_points = 8,
                            .least_side = 2,
                            .most_basis = kMaxVoxelBasis,
                            .defect_of = DefectOfVoxels,
                            .require_voxels = HasVoxels,
                            .find_points = FindVoxels,
                            .position_of = PositionOfVoxel};

std::string DefectOfSplats(const Geometry& geometry) {
  const SplatGeometry& splats = geometry.splats;
  const int64_t n = splats.opacity_logit.size();
  if (n > INT32_MAX) return Concat(n, " splats, at most ", INT32_MAX, " are supported");
  const bool agree = splats.mean.size() == 3 * n && splats.log_scale.size() == 3 * n &&
                     splats.quaternion.size() == 4 * n && geometry.density.size() == 0 &&
                     geometry.links.size() == 0 && !geometry.spheres.on();
  return agree ? "" : "the sizes of the splats' arrays disagree";
}

void HasNoVoxels() {
  throw UsageError("this is done with voxels alone", "a field of splats",
                   "fit the scene with --field voxels");
}

void FindSplat(const Geometry&, const WeightedSample& sample, int32_t* point) {
  std::fill_n(point, 8, -1);
  point[0] = sample.vertex;
}

Vec3f PositionOfSplat(const Geometry& geometry, int64_t splat, int32_t) {
  const float* const mean = geometry.splats.mean.data() + 3 * splat;
  return SplatPosition(geometry.frame, {mean[0], mean[1], mean[2]});
}

constexpr FieldKind kSplats{.name = "splats",
                            .far_records = "far splats",
                            .own_directions = true,
                            .lenses = false,
                            .lattice = false,
                            .sample_points = 1,
                            .least_side = 0,
                            .most_basis = kMaxBasis,
                            .defect_of = DefectOfSplats,
                            .require_voxels = HasNoVoxels,
                            .find_points = FindSplat,
                            .position_of = PositionOfSplat};

}  // namespace

const FieldKind& KindOf(const Geometry& geometry) {
  return geometry.splats.on() ? kSplats : kVoxels;
}

const FieldKind& KindNamed(const std::string& name) {
  for (const FieldKind* kind : {&kVoxels, &kSplats})
    if (name == kind->name) return *kind;
  throw UsageError("is no kind of field", name, "use voxels or splats");
}

}  // namespace regrade
