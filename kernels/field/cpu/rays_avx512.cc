// The fast path compiled for AVX-512 (the build adds the instruction-set flags to this file
// only).
#define REGRADE_SIMD_NAMESPACE simd_avx512
#define REGRADE_SIMD_NAME "avx512"
#include "kernels/field/cpu/rays_simd.h"
