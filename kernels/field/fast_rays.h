// The CPU's fast path for rays: vectors over the values of a voxel, density marched first,
// colours after, and gradients gathered in small private arenas. Held to ray_loss.h by the
// parity tests.
//
// A voxel's values sit in one record of `lanes` floats that fills whole cache lines:
//   basis 9: 32 lanes, basis 4: 16 lanes, basis 1: 4 lanes; sh [3, basis] first, density right
//   behind them.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/fast_spheres.h"
#include "kernels/field/radiance_field.h"
#include "kernels/field/ray_march.h"

namespace regrade {

// Lanes of a record for a basis of 1, 4 or 9.
constexpr int RecordLanes(int basis) { return basis == 9 ? 32 : basis == 4 ? 16 : 4; }
constexpr int DensityLane(int basis) { return 3 * basis; }

// Where empty space ends is kept for bricks of cells: their map stays in cache, and a ray that
// skips must wait for each look into it.
inline constexpr int kBrick = 4;  // cells along an edge

// What a ray reads at every vertex it passes: dense, so that there is no indirection, and side
// by side, so that both come in one cache line.
struct Probe {
  float density;  // 0 where nothing is stored
  int32_t link;   // voxel, or -1
};

// Owner of what the fast path reads.
struct FastGrid {
  GridFrame frame;
  Buffer<int32_t> links;            // [X, Y, Z]
  Buffer<Probe> probes;             // [X, Y, Z]
  Buffer<uint8_t> brick_distance;   // bricks of kBrick^3 cells, [X, Y, Z / kBrick rounded up]:
                                    // Chebyshev distance in bricks to the nearest one that has
                                    // a cell with a stored corner, 0 for such bricks
  Buffer<int32_t> vertex_of_voxel;  // [N]
  Buffer<float> records;            // [N, lanes]
  int basis = 9;
  Vec3f background{0, 0, 0};
  float near_clip = 0;  // world units
  FastSpheres spheres;  // behind the box, where a scene has them

  Vec3i bricks() const {
    return {(frame.resolution.x + kBrick - 1) / kBrick,
            (frame.resolution.y + kBrick - 1) / kBrick,
            (frame.resolution.z + kBrick - 1) / kBrick};
  }
  int lanes() const { return RecordLanes(basis); }
  int64_t num_voxels() const { return vertex_of_voxel.size(); }
};

FastGrid MakeFastGrid(const RadianceField& field);
// Recomputes vertex_of_voxel, brick_distance and probes from links and records.
void RefreshDerived(FastGrid* grid);
RadianceField ToRadianceField(const FastGrid& grid);

// Sparse gradient of one share of a batch: only touched voxels have a record.
struct GradientArena {
  Buffer<int32_t> slot_of_voxel;  // [N]: -1 where untouched
  Buffer<int32_t> voxel_of_slot;  // [slots]
  Buffer<float> gradient;         // [slots, lanes]
  int64_t gradient_capacity = 0;  // floats reserved in `gradient`
  SphereArena spheres;

  void Reset(int64_t num_voxels, int lanes);  // allocate and forget
  void Forget();                              // untouch, in time proportional to the slots
};

struct RayBatch {
  const Ray* rays = nullptr;
  const Vec3f* targets = nullptr;  // sRGB; unused for rendering
  int64_t size = 0;
};

// How parameters are stepped. EQ(rmsprop), svox2's: v = g^2 at first touch, then v = beta v +
// (1 - beta) g^2; x -= rate g / (sqrt(v) + epsilon), no bias correction; untouched voxels keep
// value and state bit for bit.
struct RmspropOptions {
  float beta = 0.95f;
  float epsilon = 1e-8f;
  float rate_sh = 1e-2f;
  float rate_density = 30.0f;
  // Colours are then projected: a voxel's mean colour (degree 0) into [0, 1], its
  // view-dependent coefficients into
  // [-view_bound, view_bound]. What the colour clamp hides would otherwise wander off, and come
  // to light under a colour map: clamping does not commute with it.
  float view_bound = 0.2f;
  float rate_sphere_density = 3.0f;  // of the background's layers
  float rate_sphere_color = 0.1f;
};

struct FitStepResult {
  double squared_error = 0;     // sum over rays and channels
  int64_t samples = 0;          // that were composited
  int64_t rejected_voxels = 0;  // with a non-finite gradient: kept as they were
};

// One set of functions an instruction set; FastRays() picks the best the processor has.
struct FastRayFunctions {
  const char* name;
  // color [n, 3] unclipped, depth [n] = sum w t (world), transmittance [n].
  void (*render)(const FastGrid&, const Ray*, int64_t n, const MarchOptions&, float* color,
                 float* depth, float* transmittance);
  // Renders, and adds the gradient of scale * sum (C - target)^2 to the arena. Returns squared
  // error and samples.
  FitStepResult (*accumulate)(const FastGrid&, const RayBatch&, const MarchOptions&,
                              float scale, GradientArena*);
  // Largest w_i that any ray gives a sample at each voxel's corners; weights [N] hold running
  // maxima.
  void (*max_weights)(const FastGrid&, const Ray*, int64_t n, const MarchOptions&,
                      float* weights);
  // Adds the gradient of the total variation of vertices [begin, end). See regularizers in
  // total_variation.h.
  void (*total_variation)(const FastGrid&, int64_t begin, int64_t end, float scale_density,
                          float scale_sh, GradientArena*);
  // Steps slots [begin, end) of arena `self`, summing all arenas in order; a voxel belongs to
  // its first arena.
  int64_t (*step)(FastGrid*, float* second_moment, const GradientArena* arenas, int num_arenas,
                  int self, int64_t begin, int64_t end, const RmspropOptions&);
  // alpha [n] = 1 - exp(-tau), decay [n] = exp(-tau), for tau in [0, kMaxOpticalDepth]: what
  // the marches use, for tests.
  void (*opacity)(const float* tau, int64_t n, float* alpha, float* decay);
};

const FastRayFunctions& FastRays();
// For tests and benchmarks: "baseline", "avx2", "avx512"; nullptr where the processor lacks it.
const FastRayFunctions* FastRaysFor(const char* name);

}  // namespace regrade
