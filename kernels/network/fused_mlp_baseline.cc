// The fused network compiled for the baseline instruction set.
#define REGRADE_SIMD_NAMESPACE simd_baseline
#define REGRADE_SIMD_NAME "baseline"
#include "kernels/network/fused_mlp_simd.h"
