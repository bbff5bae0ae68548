#include "kernels/field/cpu/rays.h"

#include <algorithm>
#include <cstring>

namespace regrade {

namespace simd_baseline {
extern const FastRayFunctions kFunctions;
}
namespace simd_avx2 {
extern const FastRayFunctions kFunctions;
}
namespace simd_avx512 {
extern const FastRayFunctions kFunctions;
}

const FastRayFunctions* FastRaysFor(const char* name) {
  if (std::strcmp(name, "baseline") == 0) return &simd_baseline::kFunctions;
#if defined(REGRADE_X86)
  if (std::strcmp(name, "avx2") == 0 && __builtin_cpu_supports("avx2") &&
      __builtin_cpu_supports("fma"))
    return &simd_avx2::kFunctions;
  if (std::strcmp(name, "avx512") == 0 && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw"))
    return &simd_avx512::kFunctions;
#endif
  return nullptr;
}

const FastRayFunctions& FastRays() {
  static const FastRayFunctions* const kBest = [] {
    for (const char* name : {"avx512", "avx2"})
      if (const FastRayFunctions* functions = FastRaysFor(name)) return functions;
    return FastRaysFor("baseline");
  }();
  return *kBest;
}

void GradientArena::Reset(int64_t num_voxels) {
  slot_of_voxel = Buffer<int32_t>(num_voxels);
  std::fill(slot_of_voxel.begin(), slot_of_voxel.end(), -1);
  voxel_of_slot = Buffer<int32_t>();
  gradient = Buffer<float>();
  gradient_capacity = 0;
}

void GradientArena::Forget() {
  for (const int32_t voxel : voxel_of_slot) slot_of_voxel[voxel] = -1;
  voxel_of_slot.Clear();
  gradient.Clear();
  spheres.Forget();
}

}  // namespace regrade
