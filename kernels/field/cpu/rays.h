// The CPU's fast path for rays: vectors over the values of a voxel, density marched first,
// colours after, and gradients accumulated in small private arenas. Parity tests compare it
// with render_ray.h.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/cpu/spheres.h"
#include "kernels/field/density_losses.h"
#include "kernels/field/packed_grid.h"
#include "kernels/field/ray_march.h"
#include "kernels/optimize/rmsprop.h"

namespace regrade {

// Sparse gradient of one part of a batch: only touched voxels have a record.
struct GradientArena {
  Buffer<int32_t> slot_of_voxel;  // [N]: -1 where untouched
  Buffer<int32_t> voxel_of_slot;  // [slots]
  Buffer<float> gradient;         // [slots, lanes]
  int64_t gradient_capacity = 0;  // floats reserved in `gradient`
  SphereArena spheres;

  void Reset(int64_t num_voxels);  // allocates, untouched
  void Forget();                   // marks all untouched, in time proportional to the slots
};

struct RayBatch {
  const Ray* rays = nullptr;
  const Vec3f* targets = nullptr;  // sRGB; unused for rendering
  int64_t size = 0;
  DensityLosses losses = {};  // of an adjoint
};

struct FitStepResult {
  double squared_error = 0;     // sum over rays and channels
  int64_t samples = 0;          // composited
  int64_t rejected_voxels = 0;  // not stepped: non-finite gradient
};

// One set of functions per instruction set; FastRays() picks the best the processor supports.
struct FastRayFunctions {
  const char* name;
  // color [n, 3] unclipped, depth [n] = sum w t (world), transmittance [n].
  void (*render)(const FastGrid&, const Ray*, int64_t n, const MarchOptions&, float* color,
                 float* depth, float* transmittance);
  // The same of two fields of one geometry, whose density is marched once: `other_color` [n, 3]
  // is the second one's. To the bit what two calls of `render` give.
  void (*render_pair)(const FastGrid&, const FastGrid& other, const Ray*, int64_t n,
                      const MarchOptions&, float* color, float* other_color, float* depth,
                      float* transmittance);
  // Renders, and adds the gradient of scale * sum (C - target)^2 and of the batch's losses of
  // densities to the arena. Returns squared error and number of samples.
  FitStepResult (*accumulate)(const FastGrid&, const RayBatch&, const MarchOptions&,
                              float scale, GradientArena*);
  // Largest w_i that any ray gives a sample at each voxel's corners; weights [N] are running
  // maxima.
  void (*max_weights)(const FastGrid&, const Ray*, int64_t n, const MarchOptions&,
                      float* weights);
  // Adds the gradient of the total variation of vertices [begin, end), see total_variation.h.
  void (*total_variation)(const FastGrid&, int64_t begin, int64_t end, float scale_density,
                          float scale_sh, GradientArena*);
  // Steps slots [begin, end) of arena `self` by the sum over all arenas in order; a voxel
  // belongs to the first arena that has it.
  int64_t (*step)(FastGrid*, float* second_moment, const GradientArena* arenas, int num_arenas,
                  int self, int64_t begin, int64_t end, const RmspropOptions&);
  // alpha [n] = 1 - exp(-tau), decay [n] = exp(-tau), for tau in [0, kMaxOpticalDepth]: the
  // functions the marches use, for tests.
  void (*opacity)(const float* tau, int64_t n, float* alpha, float* decay);
};

const FastRayFunctions& FastRays();
// For tests and benchmarks: "baseline", "avx2", "avx512"; nullptr if the processor lacks it.
const FastRayFunctions* FastRaysFor(const char* name);

}  // namespace regrade
