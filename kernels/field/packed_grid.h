// The packed layout of a field for fitting, rendering and device copies: a voxel's values in
// one record, and a background texel's colour and density side by side.
//
// A voxel's values are one record of `lanes` floats that fills whole cache lines:
//   basis 9: 32 lanes, basis 4: 16 lanes, basis 1: 4 lanes; sh [3, basis] first, directly
//   followed by the density.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/radiance_field.h"

namespace regrade {

struct FastSpheres {
  int layers = 0;         // 0: no background spheres
  int resolution = 0;     // R: a layer's map has 2R x R texels
  Buffer<int32_t> links;  // [2R, R]: column of a texel, or -1
  Buffer<float> texels;   // [columns, L, 4]: colour, density

  bool on() const { return layers > 0; }
  int64_t num_texels() const { return texels.size() / 4; }
};

FastSpheres MakeFastSpheres(const RadianceField& field);
void ToSphereGeometry(const FastSpheres& spheres, SphereGeometry* geometry,
                      Buffer<float>* color);

// Lanes of a record. Of splats with 16 harmonics there is no density.
constexpr int RecordLanes(int basis) {
  return basis == 16 ? 48 : basis == 9 ? 32 : basis == 4 ? 16 : 4;
}
constexpr int DensityLane(int basis) { return 3 * basis; }

// Empty-space distances are stored per brick of cells: the smaller map stays in the cache, and
// each skip has to wait for one lookup in it.
inline constexpr int kBrick = 4;  // cells along an edge

// The data a ray reads at every vertex it passes: a dense array, without indirection, both
// values in one cache line.
struct Probe {
  float density;  // 0 where nothing is stored
  int32_t link;   // voxel, or -1
};

// A field in the packed layout, with the arrays derived from it.
struct FastGrid {
  GridFrame frame;
  Buffer<int32_t> links;            // [X, Y, Z]
  Buffer<Probe> probes;             // [X, Y, Z]
  Buffer<uint8_t> brick_distance;   // bricks of kBrick^3 cells, [X, Y, Z / kBrick rounded up]:
                                    // Chebyshev distance in bricks to the nearest brick with a
                                    // stored corner, 0 for such bricks
  Buffer<int32_t> vertex_of_voxel;  // [N]
  Buffer<float> records;            // [N, lanes]
  int basis = 9;
  Vec3f background{0, 0, 0};
  float near_clip = 0;  // world units
  FastSpheres spheres;  // background layers, if any

  Vec3i bricks() const {
    return {(frame.resolution.x + kBrick - 1) / kBrick,
            (frame.resolution.y + kBrick - 1) / kBrick,
            (frame.resolution.z + kBrick - 1) / kBrick};
  }
  int lanes() const { return RecordLanes(basis); }
  int64_t num_voxels() const { return records.size() / lanes(); }
};

FastGrid MakeFastGrid(const RadianceField& field);
// Recomputes the arrays that derive from links and records.
void RefreshDerived(FastGrid* grid);
RadianceField ToRadianceField(const FastGrid& grid);

}  // namespace regrade
