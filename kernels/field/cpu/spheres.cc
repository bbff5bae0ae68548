#include "kernels/field/cpu/spheres.h"

#include <algorithm>
#include <cmath>

#include "kernels/field/sphere_variation.h"
#include "kernels/field/spherical_harmonics.h"

namespace regrade {

void SphereArena::Reset(int64_t num_texels) {
  *this = SphereArena();
  slot_of_texel.Resize(num_texels);
  std::fill(slot_of_texel.begin(), slot_of_texel.end(), -1);
}

void SphereArena::Forget() {
  for (const int32_t texel : texel_of_slot) slot_of_texel[texel] = -1;
  texel_of_slot.Clear();
  gradient.Clear();
}

void SphereArena::Grow() {
  reserved_ = std::max(1024, 2 * reserved_);
  texel_of_slot.Reserve(reserved_);
  gradient.Reserve(4 * int64_t{reserved_});
}

void SphereVariationGradient(const FastSpheres& spheres, int64_t begin, int64_t end,
                             float scale_density, float scale_color, SphereArena* arena) {
  for (int c = 0; c < 4; ++c)
    SphereVariation(spheres.layers, spheres.resolution, spheres.links.data(),
                    spheres.texels.data(), 4, c, begin, end,
                    c == 3 ? scale_density : scale_color, [&](int32_t texel, float value) {
                      arena->gradient[4 * int64_t{arena->SlotOf(texel)} + c] += value;
                    });
}

int64_t StepSpheres(FastSpheres* spheres, float* second_moment,
                    const SphereArena* const* arenas, int num_arenas, int self, int64_t begin,
                    int64_t end, const RmspropOptions& options) {
  int64_t rejected = 0;
  for (int64_t slot = begin; slot < end; ++slot) {
    const int32_t texel = arenas[self]->texel_of_slot[slot];
    bool mine = true;
    for (int other = 0; other < self; ++other)
      mine = mine && arenas[other]->slot_of_texel[texel] < 0;
    if (!mine) continue;
    float g[4];
    std::copy_n(arenas[self]->gradient.data() + 4 * slot, 4, g);
    for (int other = self + 1; other < num_arenas; ++other) {
      const int32_t other_slot = arenas[other]->slot_of_texel[texel];
      if (other_slot < 0) continue;
      for (int c = 0; c < 4; ++c) g[c] += arenas[other]->gradient[4 * int64_t{other_slot} + c];
    }
    if (!std::isfinite(g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + g[3] * g[3])) {
      ++rejected;
      continue;
    }
    float* const x = spheres->texels.data() + 4 * int64_t{texel};
    float* const v = second_moment + 4 * int64_t{texel};
    for (int c = 0; c < 4; ++c) {
      const float squared = g[c] * g[c];
      v[c] = v[c] == 0 ? squared : options.beta * v[c] + (1 - options.beta) * squared;
      const float rate = c == 3 ? options.rate_sphere_density : options.rate_sphere_color;
      x[c] -= rate * g[c] / (std::sqrt(v[c]) + options.epsilon);
      if (c < 3) x[c] = std::clamp(x[c], -options.mean_bound, options.mean_bound);
    }
  }
  return rejected;
}

}  // namespace regrade
