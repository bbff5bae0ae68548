// Tiles of splats compiled for the baseline instruction set.
#define REGRADE_SIMD_NAMESPACE simd_baseline
#define REGRADE_SIMD_NAME "baseline"
#include "kernels/splats/cpu/splat_tile_simd.h"
