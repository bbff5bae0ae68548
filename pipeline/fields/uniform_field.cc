#include "pipeline/fields/uniform_field.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/field/field_sampler.h"

namespace regrade {
namespace {

// Of a vertex of the new grid.
CellCorners CornersAt(const Geometry& from, const FieldSampler& sampler,
                      const Vec3i& resolution, const Vec3i& index) {
  Vec3f place;  // voxels from the box's corner
  for (int a = 0; a < 3; ++a)
    place[a] = (static_cast<float>(index[a]) + 0.5f) *
               static_cast<float>(from.frame.resolution[a]) / static_cast<float>(resolution[a]);
  return sampler.At(place);
}

template <typename Body>
void ForEachVertex(const Vec3i& n, const Body& body) {
#pragma omp parallel for schedule(dynamic, 1)
  for (int x = 0; x < n.x; ++x)
    for (int y = 0; y < n.y; ++y)
      for (int z = 0; z < n.z; ++z) body((int64_t{x} * n.y + y) * n.z + z, x, y, z);
}

void CheckMemory(double bytes, const Vec3i& n, uint64_t memory) {
  if (bytes <= static_cast<double>(memory)) return;
  throw ResourceError("a grid of " + std::to_string(n.x) + " x " + std::to_string(n.y) + " x " +
                          std::to_string(n.z) + " takes " +
                          std::to_string(std::llround(bytes * 1e-6)) + " MB, " +
                          std::to_string(memory / 1000000) + " MB are free",
                      "", "lower --resolution; memory grows with its cube");
}

}  // namespace

Vec3i UniformResolution(const RadianceField& field, int longest) {
  const Vec3i own = field.geometry->frame.resolution;
  const int side = std::max({own.x, own.y, own.z});
  if (longest == 0)
    longest = field.geometry->cells.on() ? std::min(side, kMostUniformVoxels) : side;
  Vec3i resolution;
  for (int a = 0; a < 3; ++a)
    resolution[a] = std::max(
        2, static_cast<int>(std::lround(static_cast<double>(own[a]) * longest / side)));
  return resolution;
}

RadianceField ToUniform(const RadianceField& field, const Vec3i& resolution, uint64_t memory) {
  const Geometry& from = *field.geometry;
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = {resolution, from.frame.center, from.frame.radius};
  geometry->spheres = from.spheres;
  const double vertices = static_cast<double>(geometry->frame.NumVertices());
  CheckMemory(vertices * sizeof(int32_t), resolution, memory);
  const FieldSampler sampler(from);
  const auto corners_at = [&](int x, int y, int z) {
    return CornersAt(from, sampler, resolution, {x, y, z});
  };
  geometry->links.Resize(geometry->frame.NumVertices());
  ForEachVertex(resolution, [&](int64_t v, int x, int y, int z) {
    geometry->links[v] = corners_at(x, y, z).any() ? 0 : -1;
  });
  int64_t voxels = 0;
  for (int32_t& link : geometry->links)
    if (link >= 0) link = static_cast<int32_t>(voxels++);
  RadianceField uniform = field;
  const int stride = field.appearance.stride();
  CheckMemory(vertices * sizeof(int32_t) + static_cast<double>(voxels) * 4 * (1 + stride),
              resolution, memory);
  geometry->density.Resize(voxels);
  uniform.appearance.sh = Buffer<float>(voxels * stride);
  ForEachVertex(resolution, [&](int64_t v, int x, int y, int z) {
    const int64_t voxel = geometry->links[v];
    if (voxel < 0) return;
    const CellCorners corners = corners_at(x, y, z);
    Blend(corners, from.density, 1, geometry->density.data() + voxel);
    Blend(corners, field.appearance.sh, stride, uniform.appearance.sh.data() + voxel * stride);
  });
  uniform.geometry = std::move(geometry);
  return uniform;
}

}  // namespace regrade
