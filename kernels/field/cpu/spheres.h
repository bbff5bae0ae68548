// The background's layers on the CPU's fast path: sparse gradients and the optimizer's step.
// Parity tests compare it with background_spheres.h.
#pragma once

#include <cstdint>

#include "kernels/base/buffer.h"
#include "kernels/field/packed_grid.h"
#include "kernels/optimize/rmsprop.h"

namespace regrade {

// Sparse gradient of one part of a batch, as GradientArena is for voxels.
struct SphereArena {
  Buffer<int32_t> slot_of_texel;  // [texels]: -1 where untouched
  Buffer<int32_t> texel_of_slot;  // [slots]
  Buffer<float> gradient;         // [slots, 4]

  void Reset(int64_t num_texels);
  void Forget();
  // Slot of a texel, created and zeroed at its first touch.
  int32_t SlotOf(int32_t texel) {
    int32_t slot = slot_of_texel[texel];
    if (slot >= 0) return slot;
    slot = static_cast<int32_t>(texel_of_slot.size());
    if (slot == reserved_) Grow();
    slot_of_texel[texel] = slot;
    texel_of_slot.Resize(slot + 1);
    texel_of_slot[slot] = texel;
    gradient.Resize(4 * (int64_t{slot} + 1));
    return slot;
  }

 private:
  void Grow();

  int32_t reserved_ = 0;
};

// Adds the gradient of EQ(sphere-variation) over texels [begin, end) of the map.
void SphereVariationGradient(const FastSpheres& spheres, int64_t begin, int64_t end,
                             float scale_density, float scale_color, SphereArena* arena);

// See EQ(rmsprop). Steps slots [begin, end) of arena `self` by the sum over all arenas in
// order; a texel belongs to the first arena that has it. Colours are projected into [0, 1].
// Returns the number of texels with a non-finite gradient, which are not stepped.
int64_t StepSpheres(FastSpheres* spheres, float* second_moment,
                    const SphereArena* const* arenas, int num_arenas, int self, int64_t begin,
                    int64_t end, const RmspropOptions& options);

}  // namespace regrade
