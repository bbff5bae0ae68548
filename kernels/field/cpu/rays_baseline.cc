// The fast path compiled for the baseline instruction set.
#define REGRADE_SIMD_NAMESPACE simd_baseline
#define REGRADE_SIMD_NAME "baseline"
#include "kernels/field/cpu/rays_simd.h"
