// The fused network compiled for AVX2 (the build adds the instruction-set flags to this file
// only).
#define REGRADE_SIMD_NAMESPACE simd_avx2
#define REGRADE_SIMD_NAME "avx2"
#include "kernels/network/fused_mlp_simd.h"
