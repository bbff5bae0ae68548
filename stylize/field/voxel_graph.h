// Which voxels are neighbours, and how alike their colours are: what a residual by voxel
// spreads along.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "kernels/field/radiance_field.h"

namespace regrade {

struct VoxelGraph {
  int64_t voxels = 0;
  std::vector<std::array<int32_t, 2>> edges;  // each pair once, in order
  std::vector<float> likeness;                // [edges], k of EQ(voxel-residual)
  // Of each voxel, its edges: `edge_of[first_edge[v] .. first_edge[v + 1])`.
  std::vector<int64_t> first_edge;
  std::vector<int32_t> edge_of;
  // Cubes of 2, 4, ... 64 voxels: [levels][voxels], numbered from 0. Of splats 64 are as wide
  // as the box.
  std::vector<std::vector<int32_t>> cubes;
};

// Neighbours are the stored voxels that are next to each other along an axis; of splats, which
// have no lattice, the six whose means are nearest, in the positions of FillFeatures, from
// either side. Texels of background spheres are no voxels.
VoxelGraph GraphOf(const RadianceField& field);

}  // namespace regrade
