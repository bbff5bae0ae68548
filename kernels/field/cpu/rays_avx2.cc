// The fast path for processors with avx2 instructions (the build adds their flags to this file
// alone).
#define REGRADE_SIMD_NAMESPACE simd_avx2
#define REGRADE_SIMD_NAME "avx2"
#include "kernels/field/cpu/rays_simd.h"
