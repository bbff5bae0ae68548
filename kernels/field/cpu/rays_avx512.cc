// The fast path for processors with avx512 instructions (the build adds their flags to this
// file alone).
#define REGRADE_SIMD_NAMESPACE simd_avx512
#define REGRADE_SIMD_NAME "avx512"
#include "kernels/field/cpu/rays_simd.h"
