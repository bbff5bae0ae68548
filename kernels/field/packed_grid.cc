#include "kernels/field/packed_grid.h"

#include <algorithm>
#include <memory>
#include <vector>

#include "kernels/field/field_kind.h"

namespace regrade {

FastSpheres MakeFastSpheres(const RadianceField& field) {
  const SphereGeometry& geometry = field.geometry->spheres;
  FastSpheres spheres;
  if (!geometry.on()) return spheres;
  spheres.layers = geometry.layers;
  spheres.resolution = geometry.resolution;
  spheres.links = geometry.links;
  spheres.texels.Resize(4 * geometry.num_texels());
  for (int64_t i = 0; i < geometry.num_texels(); ++i) {
    std::copy_n(field.appearance.sphere_color.data() + 3 * i, 3, spheres.texels.data() + 4 * i);
    spheres.texels[4 * i + 3] = geometry.density[i];
  }
  return spheres;
}

void ToSphereGeometry(const FastSpheres& spheres, SphereGeometry* geometry,
                      Buffer<float>* color) {
  *geometry = {spheres.layers, spheres.resolution, spheres.links,
               Buffer<float>(spheres.num_texels())};
  *color = Buffer<float>(3 * spheres.num_texels());
  for (int64_t i = 0; i < spheres.num_texels(); ++i) {
    std::copy_n(spheres.texels.data() + 4 * i, 3, color->data() + 3 * i);
    geometry->density[i] = spheres.texels[4 * i + 3];
  }
}

FastGrid MakeFastGrid(const RadianceField& field) {
  KindOf(*field.geometry).require_voxels();
  FastGrid grid;
  const Geometry& geometry = *field.geometry;
  grid.frame = geometry.frame;
  grid.links = geometry.links;
  grid.basis = field.appearance.basis;
  grid.background = field.background;
  grid.near_clip = field.near_clip;
  grid.spheres = MakeFastSpheres(field);
  const int64_t n = geometry.num_voxels();
  const int lanes = grid.lanes(), stride = field.appearance.stride();
  grid.records.Resize(n * lanes);
  for (int64_t v = 0; v < n; ++v) {
    std::copy_n(field.appearance.sh.data() + v * stride, stride,
                grid.records.data() + v * lanes);
    grid.records[v * lanes + DensityLane(grid.basis)] = geometry.density[v];
  }
  RefreshDerived(&grid);
  return grid;
}

RadianceField ToRadianceField(const FastGrid& grid) {
  auto geometry = std::make_shared<Geometry>();
  geometry->frame = grid.frame;
  geometry->links = grid.links;
  const int64_t n = grid.num_voxels();
  const int lanes = grid.lanes();
  geometry->density.Resize(n);
  RadianceField field;
  field.appearance.basis = grid.basis;
  const int stride = field.appearance.stride();
  field.appearance.sh.Resize(n * stride);
#pragma omp parallel for schedule(static)
  for (int64_t v = 0; v < n; ++v) {
    std::copy_n(grid.records.data() + v * lanes, stride,
                field.appearance.sh.data() + v * stride);
    geometry->density[v] = grid.records[v * lanes + DensityLane(grid.basis)];
  }
  ToSphereGeometry(grid.spheres, &geometry->spheres, &field.appearance.sphere_color);
  field.geometry = std::move(geometry);
  field.background = grid.background;
  field.near_clip = grid.near_clip;
  return field;
}

namespace {

// Two sweeps along one axis: distance <= neighbour + 1. Three axes give the Chebyshev distance
// if each pass takes the minimum over max(distance, steps along the axis); computed here by
// separable dilation counts.
void SpreadAxis(const Vec3i& n, int axis, Buffer<uint8_t>* distance) {
  const int64_t strides[3] = {static_cast<int64_t>(n.y) * n.z, n.z, 1};
  const int length = n[axis];
  const int64_t stride = strides[axis];
  const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
#pragma omp parallel for schedule(static)
  for (int a = 0; a < n[u]; ++a) {
    std::vector<uint8_t> line(static_cast<size_t>(length));
    for (int b = 0; b < n[v]; ++b) {
      uint8_t* p = distance->data() + a * strides[u] + b * strides[v];
      for (int i = 0; i < length; ++i) line[static_cast<size_t>(i)] = p[i * stride];
      // out(i) = min over j of max(line(j), |i - j|): increase the radius until it covers the
      // smallest value found.
      for (int i = 0; i < length; ++i) {
        int best = line[static_cast<size_t>(i)];
        for (int r = 1; r < best; ++r) {
          if (i - r >= 0)
            best = std::min(best, std::max<int>(line[static_cast<size_t>(i - r)], r));
          if (i + r < length)
            best = std::min(best, std::max<int>(line[static_cast<size_t>(i + r)], r));
        }
        p[i * stride] = static_cast<uint8_t>(best);
      }
    }
  }
}

}  // namespace

void RefreshDerived(FastGrid* grid) {
  const GridFrame& frame = grid->frame;
  const Vec3i n = frame.resolution;
  const int lanes = grid->lanes();
  const int64_t voxels = grid->records.size() / lanes;
  const int64_t vertices = frame.NumVertices();
  grid->vertex_of_voxel = Buffer<int32_t>(voxels);
  grid->probes = Buffer<Probe>(vertices);
  std::fill(grid->probes.begin(), grid->probes.end(), Probe{0.0f, -1});
  const Vec3i bricks = grid->bricks();
  grid->brick_distance = Buffer<uint8_t>(static_cast<int64_t>(bricks.x) * bricks.y * bricks.z);
  constexpr uint8_t kFar = 64;
  std::fill(grid->brick_distance.begin(), grid->brick_distance.end(), kFar);
  for (int x = 0; x < n.x; ++x)
    for (int y = 0; y < n.y; ++y)
      for (int z = 0; z < n.z; ++z) {
        const int64_t vertex = frame.Vertex(x, y, z);
        const int32_t link = grid->links[vertex];
        if (link < 0) continue;
        grid->vertex_of_voxel[link] = static_cast<int32_t>(vertex);
        grid->probes[vertex] = {
            grid->records[static_cast<int64_t>(link) * lanes + DensityLane(grid->basis)], link};
        // A vertex is a corner of the cells whose lowest corners are at most one below it.
        for (int bx = std::max(x - 1, 0) / kBrick; bx <= x / kBrick; ++bx)
          for (int by = std::max(y - 1, 0) / kBrick; by <= y / kBrick; ++by)
            for (int bz = std::max(z - 1, 0) / kBrick; bz <= z / kBrick; ++bz)
              grid->brick_distance[(static_cast<int64_t>(bx) * bricks.y + by) * bricks.z + bz] =
                  0;
      }
  for (int axis = 0; axis < 3; ++axis) SpreadAxis(bricks, axis, &grid->brick_distance);
}

}  // namespace regrade
