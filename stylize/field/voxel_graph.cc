#include "stylize/field/voxel_graph.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/field_kind.h"
#include "kernels/field/spherical_harmonics.h"
#include "kernels/scene/nearest_points.h"
#include "stylize/field/lipschitz_network.h"

namespace regrade {
namespace {

constexpr float kWidth = 0.2f;  // of colour, in units of white: s of EQ(voxel-residual)
constexpr float kLeast = 0.1f;  // what voxels of different colours still tell each other
constexpr int kLevels = 6;
constexpr int kNearest = 6;          // splats
constexpr float kPlacesAcross = 64;  // of the box, for cubes of splats

void AddNearestEdges(const std::vector<Vec3f>& positions,
                     std::vector<std::array<int32_t, 2>>* edges) {
  const std::vector<int32_t> nearest = NearestPoints(positions, kNearest);
  for (size_t i = 0; i < nearest.size(); ++i) {
    const int32_t a = static_cast<int32_t>(i / kNearest), b = nearest[i];
    if (b >= 0) edges->push_back({std::min(a, b), std::max(a, b)});
  }
  std::sort(edges->begin(), edges->end());
  edges->erase(std::unique(edges->begin(), edges->end()), edges->end());
}

// In the box's proportions: within [-2, 2], see EQ(splat-position).
std::vector<Vec3f> PositionsOffLattice(const Geometry& geometry, const FieldKind& kind) {
  const Vec3f& radius = geometry.frame.radius;
  const float longest = std::max({radius.x, radius.y, radius.z});
  std::vector<Vec3f> positions;
  for (int64_t v = 0; v < geometry.num_voxels(); ++v) {
    Vec3f& position =
        positions.emplace_back(kind.position_of(geometry, v, static_cast<int32_t>(v)));
    for (int a = 0; a < 3; ++a) position[a] = position[a] * radius[a] / longest;
  }
  return positions;
}

void AddGridEdges(const Geometry& geometry, const std::vector<int32_t>& vertex,
                  std::vector<std::array<int32_t, 2>>* edges) {
  const Vec3i n = geometry.frame.resolution;
  const int32_t strides[3] = {n.y * n.z, n.z, 1};
  for (int64_t v = 0; v < geometry.num_voxels(); ++v) {
    const int32_t at[3] = {vertex[v] / strides[0], vertex[v] / n.z % n.y, vertex[v] % n.z};
    for (int a = 0; a < 3; ++a) {
      if (at[a] + 1 >= n[a]) continue;
      const int32_t next = geometry.links[vertex[v] + strides[a]];
      if (next >= 0) edges->push_back({static_cast<int32_t>(v), next});
    }
  }
}

Vec3f ColorOf(const Appearance& appearance, int64_t voxel) {
  const float* sh = appearance.sh.data() + voxel * appearance.stride();
  Vec3f color;
  for (int c = 0; c < 3; ++c)
    color[c] = 0.5f + static_cast<float>(kSh0) * sh[c * appearance.basis];
  return color;
}

// Cubes of 2^level voxels; only those that hold a voxel get a number.
std::vector<int32_t> CubesOf(const std::vector<Vec3i>& places, int level) {
  std::vector<std::pair<uint64_t, int32_t>> keys(places.size());
  for (size_t v = 0; v < places.size(); ++v) {
    uint64_t key = 0;
    for (int a = 0; a < 3; ++a) key = key << 21 | static_cast<uint64_t>(places[v][a] >> level);
    keys[v] = {key, static_cast<int32_t>(v)};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int32_t> cube(places.size());
  int32_t next = -1;
  for (size_t i = 0; i < keys.size(); ++i) {
    if (i == 0 || keys[i].first != keys[i - 1].first) ++next;
    cube[static_cast<size_t>(keys[i].second)] = next;
  }
  return cube;
}

}  // namespace

VoxelGraph GraphOf(const RadianceField& field) {
  const Geometry& geometry = *field.geometry;
  VoxelGraph graph;
  graph.voxels = geometry.num_voxels();
  const std::vector<int32_t> vertex = VertexOfVoxel(geometry);
  std::vector<Vec3i> places(vertex.size());
  const Vec3i n = geometry.frame.resolution;
  if (const FieldKind& kind = KindOf(geometry); !kind.lattice) {
    const std::vector<Vec3f> positions = PositionsOffLattice(geometry, kind);
    AddNearestEdges(positions, &graph.edges);
    for (size_t v = 0; v < places.size(); ++v)
      for (int a = 0; a < 3; ++a)
        places[v][a] = static_cast<int32_t>((positions[v][a] + 2) * (kPlacesAcross / 2));
  } else {
    AddGridEdges(geometry, vertex, &graph.edges);
    for (size_t v = 0; v < places.size(); ++v)
      places[v] = {vertex[v] / (n.y * n.z), vertex[v] / n.z % n.y, vertex[v] % n.z};
  }
  graph.first_edge.assign(static_cast<size_t>(graph.voxels) + 1, 0);
  for (const auto& edge : graph.edges) {
    const Vec3f d = ColorOf(field.appearance, edge[0]) - ColorOf(field.appearance, edge[1]);
    graph.likeness.push_back(kLeast + std::exp(-Dot(d, d) / (2 * kWidth * kWidth)));
    for (const int32_t v : edge) ++graph.first_edge[static_cast<size_t>(v) + 1];
  }
  for (size_t v = 0; v < places.size(); ++v) graph.first_edge[v + 1] += graph.first_edge[v];
  graph.edge_of.resize(2 * graph.edges.size());
  std::vector<int64_t> next(graph.first_edge.begin(), graph.first_edge.end() - 1);
  for (size_t e = 0; e < graph.edges.size(); ++e)
    for (const int32_t v : graph.edges[e])
      graph.edge_of[static_cast<size_t>(next[static_cast<size_t>(v)]++)] =
          static_cast<int32_t>(e);
  for (int level = 1; level <= kLevels; ++level) graph.cubes.push_back(CubesOf(places, level));
  return graph;
}

}  // namespace regrade
