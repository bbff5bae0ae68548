// Tiles of splats compiled for AVX-512 (the build adds the instruction-set flags to this file
// only).
#define REGRADE_SIMD_NAMESPACE simd_avx512
#define REGRADE_SIMD_NAME "avx512"
#include "kernels/splats/cpu/splat_tile_simd.h"
