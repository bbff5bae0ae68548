// Tiles of splats compiled for AVX2 (the build adds the instruction-set flags to this file
// only).
#define REGRADE_SIMD_NAMESPACE simd_avx2
#define REGRADE_SIMD_NAME "avx2"
#include "kernels/splats/cpu/splat_tile_simd.h"
